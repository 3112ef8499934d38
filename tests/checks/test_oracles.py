"""Checks in regions, with units, against closed forms and against references."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from simulate import G

import particlesim as ps
from particlesim.errors import ScenarioError, UsageError
from particlesim.expressions.operations import FUNCTIONS, VARIABLES, value
from particlesim.expressions.parser import on_arrays, parse
from particlesim.laws.registry import Particle
from particlesim.sampling.regions import HalfSpace, inside
from particlesim.sampling.shapes import Ball, Box

SCENARIO = """
[simulation]
duration = 1.0
dt = 0.01
integrator = "velocity_verlet"
[output]
every = 25
precision = "double"
[[particles]]
name = "balls"
layout = { type = "points", position = [[0, 1, 0], [1, 2, 0], [2, 4, 1]], velocity = [[3, 0, 0], [0, 5, 0], [0, 0, -2]] }
mass = 2.0
[[particles]]
name = "wall"
layout = { type = "points", position = [[0, 100, 0]] }
pinned = true
[[forces]]
type = "gravity"
"""


def scenario(*checks: str, text: str = SCENARIO) -> ps.Scenario:
    return ps.loads(text + "".join(f"\n[[checks]]\n{check}\n" for check in checks))


def results(*checks: str) -> tuple[Any, ...]:
    return ps.run(scenario(*checks), threads=1).checks


FALL = 'quantity = "position.y"\ngroup = "balls"\nat = "always"\ntolerance = 1e-12\n'


def test_free_fall_of_every_particle() -> None:
    # Velocity Verlet is exact for a constant force; 100 steps round some 1e-15 m each.
    right, wrong, relative = results(
        FALL + f'expression = "y0 + vy0*t - {G}*t**2/2"',
        FALL + 'expression = "y0 + vy0*t - g*t**2/2"\nconstants = { g = 9.80 }',
        FALL.replace("tolerance = 1e-12", "relative_tolerance = 0.1")
        + f'expression = "y0 + vy0*t - {G}*t**2/2 + 0.05*abs(y)"',
    )
    assert right.passed, right.message
    assert relative.passed, relative.message
    assert not wrong.passed
    assert wrong.time == 1.0
    assert "instead of" in wrong.message
    assert "for particle" in wrong.message
    assert abs(wrong.value - (1 - G / 2)) < 9  # one of the three


def test_relations_of_what_a_particle_has_now() -> None:
    # Energy of each: v²/2 + g y stays what it was.
    (kept,) = results(
        'quantity = "speed"\ngroup = "balls"\nat = "always"\ntolerance = "1e-9 cm/s"\n'
        f'expression = "sqrt(vx0**2 + vy0**2 + vz0**2 + 2*{G}*(y0 - y))"'
    )
    assert kept.passed, kept.message


def test_totals_and_statistics_follow_the_time() -> None:
    momentum, mean, late = results(
        f'quantity = "momentum.y"\nexpression = "10 - 6*{G}*t"\nat = "always"\ntolerance = 1e-9',
        f'quantity = "velocity.y"\nstatistic = "mean"\ngroup = "balls"\nexpression = "5/3 - {G}*t"\ntolerance = "1 nm/s"',
        'quantity = "momentum.y"\nexpression = "10"\nat = 0.25\ntolerance = 1e-9',
    )
    assert momentum.passed, momentum.message
    assert mean.passed, mean.message
    assert not late.passed
    assert "instead of 10" in late.message


def test_a_formula_that_is_no_number_fails() -> None:
    (bad,) = results('quantity = "momentum.x"\nexpression = "sqrt(0.5 - t)"\ntolerance = 1e9')
    assert not bad.passed


BOX = 'region = { type = "box", min = [-1, -10, -1], max = [1.5, 10, 1] }'


def test_regions() -> None:
    inside_box, below, ball, far = results(
        f'quantity = "count"\n{BOX}\nequals = 1',
        'quantity = "count"\nregion = { type = "half_space", point = [0, 3, 0], normal = [0, -2, 0] }\nequals = 3',
        'quantity = "count"\nat = 0\nregion = { type = "ball", center = [1, 2, 0], radius = "150 cm" }\nequals = 2',
        'quantity = "position.y"\nstatistic = "min"\nregion = { type = "half_space", point = [0, 50, 0] }\nmin = 99',
    )
    for check in (inside_box, below, ball, far):
        assert check.passed, check.message
    assert inside_box.name == "count in a box"
    assert below.name == "count in a half-space"


def test_the_surface_belongs_to_a_region() -> None:
    points = np.array([[1.0, 0, 0], [1 + 1e-15, 0, 0], [0, 0, 0]])
    assert inside(Box(min=(0, 0, 0), max=(1, 1, 1)), points).tolist() == [True, False, True]
    assert inside(Ball(radius=1.0), points).tolist() == [True, False, True]
    assert inside(HalfSpace(point=(1, 0, 0), normal=(1, 0, 0)), points).tolist() == [True, True, False]


def test_units_of_bounds() -> None:
    checks = scenario(
        'quantity = "position.x"\nstatistic = "max"\nmin = "3 cm"\nmax = "0.1 km"',
        'quantity = "momentum"\nequals = "600 g m/s"\ntolerance = "1 N s"',
        'quantity = "energy.drift"\nmax = "5 %"',
        'quantity = "angular_momentum.x"\nmax = "2 kg m^2/s"',
        'quantity = "potential.gravity"\nmax = "2 kJ"',
    ).checks
    assert [(c.min, c.max) for c in checks] == [
        (0.03, 100),
        (None, None),
        (None, 0.05),
        (None, 2),
        (None, 2000),
    ]
    assert (checks[1].equals, checks[1].tolerance) == (0.6, 1)


def test_a_tolerance_of_temperatures_is_a_difference() -> None:
    warm = SCENARIO.replace("mass = 2.0", "mass = 2.0\ntemperature = 300")
    check = 'quantity = "temperature"\nstatistic = "max"\ngroup = "balls"\nequals = "27 degC"\ntolerance = "1 degC"'
    (only,) = ps.run(scenario(check, text=warm), threads=1).checks
    assert only.passed, only.message
    assert scenario(check, text=warm).checks[0].tolerance == 1


WRONG = [
    ('quantity = "momentum"\nmax = "3 m"', "an angular|impulse|expected", None),
    ('quantity = "enrgy"\nmax = "3 m"', "no quantity", None),
    ('quantity = "position.y"\nexpression = "1 +"\ntolerance = 1', "not an expression", None),
    ('quantity = "position.y"\nexpression = "y1 + t"\ntolerance = 1', "unknown name 'y1'", "y0"),
    ('quantity = "momentum"\nexpression = "x0"', "unknown name 'x0'", None),
    ('quantity = "momentum"\nexpression = "t^2"', "unknown operator", "a**b"),
    ('quantity = "position.y"\nexpression = "T"', "no temperature", None),
    ('quantity = "momentum"\nexpression = "t"\nmax = 1', "contradict", None),
    ('quantity = "momentum"\nexpression = "t"\nequals = 1', "contradict", None),
    ('quantity = "momentum"\nmax = 1\nconstants = { k = 1 }', "belong to an expression", None),
    ('quantity = "momentum"\nexpression = "1"\nconstants = { x0 = 1 }', "value at the start", None),
    (f'quantity = "momentum"\nmax = 1\n{BOX}', "sum over all of space", None),
    (
        'quantity = "count"\nmax = 1\nregion = { type = "half_space", normal = [0, 0, 0] }',
        "points nowhere",
        None,
    ),
    ('quantity = "energy"\nreference = "a.vtkhdf"', "particle by particle", None),
    ('quantity = "speed"\nstatistic = "max"\nreference = "a.vtkhdf"', "particle by particle", None),
    ('quantity = "force"\nreference = "a.vtkhdf"', "is not recorded", 'fields = ["velocity", "force"]'),
    (
        'quantity = "position"\nreference = "a.toml"',
        "a reference is a trajectory",
        "references/fountain.vtkhdf",
    ),
    ('quantity = "position"\nequals = 1', "unknown quantity", "position.x"),
]


@pytest.mark.parametrize(("check", "message", "hint"), WRONG, ids=lambda case: str(case)[:60])
def test_mistakes(check: str, message: str, hint: str | None) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(check)
    told = caught.value.diagnostics[0]
    assert any(word in told.message for word in message.split("|")), told
    assert told.path.startswith("checks.0")
    assert told.span is not None
    assert hint is None or hint in str(told.hint)


def test_emitted_particles_have_no_start() -> None:
    emitter = '\n[[emitters]]\nname = "sparks"\nrate = 9\nshape = { type = "point", position = [0, 0, 0] }\n'
    check = 'quantity = "position.y"\nexpression = "y0"\ntolerance = 1\n'
    with pytest.raises(ScenarioError, match="emitted"):
        scenario(check, text=SCENARIO + emitter)
    scenario(check + 'group = "balls"', text=SCENARIO + emitter)


def test_expressions_on_arrays_are_those_of_the_kernels() -> None:
    """Every function and operator, on columns, against its law for single particles."""
    particles = [Particle(x, 0.5, 0.3, 1.0, -2.0, 0.1, 2.0, 0.1, 300.0, 0.7) for x in (0.1, 0.5, 0.9)]
    texts = [f"{name}({', '.join(['x', 'y'][: len(f._fields)])})" for name, f in FUNCTIONS.items()]  # type: ignore[attr-defined]
    texts += ["-x + y*z/vx - vy", "x**3", "x**y", "x**2", "y if x < y else z", "m*r*T*t*vz", "2"]
    names = {type(node): name for name, node in VARIABLES.items()}
    for text in texts:
        node = parse(text, {})

        def variable(leaf: Any) -> Any:
            return np.array([getattr(p, names[type(leaf)]) for p in particles])

        many = np.broadcast_to(on_arrays(node, variable), 3)
        assert many.tolist() == [float(value(node, p)) for p in particles], text
    assert np.isnan(on_arrays(parse("sqrt(x)", {}), lambda _: np.array([-1.0]))).all()
    assert np.isinf(on_arrays(parse("1/x", {}), lambda _: np.array([0.0]))).all()


REFERENCE = 'quantity = "position"\nreference = "right.vtkhdf"\nat = "always"\ntolerance = "1 mm"'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "balls.toml"
    path.write_text(f"{SCENARIO}\n[[checks]]\n{REFERENCE}\n[[checks]]\nquantity = 'count'\nequals = 4\n")
    return path


def test_a_reference_is_written_by_bless_only(file, tmp_path) -> None:
    right, out = tmp_path / "right.vtkhdf", tmp_path / "out.vtkhdf"
    with pytest.raises(UsageError, match="no reference") as caught:
        ps.run(ps.load(file), out)
    assert "--bless" in str(caught.value.hint)
    assert not out.exists()
    blessed = ps.run(ps.load(file), out, bless=True)
    assert [check.name for check in blessed.checks] == ["count"]
    assert right.read_bytes() == out.read_bytes()
    stamp = right.stat().st_mtime_ns
    assert ps.run(ps.load(file), out, overwrite=True).passed
    assert right.stat().st_mtime_ns == stamp
    near = ps.run(ps.load(file, {"particles.balls.layout.velocity": [[3.0005, 0, 0], [0, 5, 0], [0, 0, -2]]}))
    assert near.passed
    assert near.checks[0].value == pytest.approx(0.5e-3, rel=1e-6)
    off = ps.run(ps.load(file, {"particles.balls.layout.velocity": [[3, 0, 0], [0, 5, 0], [0, 0, -2.01]]}))
    (check, _) = off.checks
    assert not check.passed
    assert check.value == pytest.approx(0.01, rel=1e-9)
    assert "off for particle 2" in check.message
    with pytest.raises(UsageError, match="is the reference"):
        ps.run(ps.load(file), right, overwrite=True, bless=True)


def test_nothing_is_blessed_when_another_check_fails(file, tmp_path) -> None:
    run = ps.load(file, ["checks.1.equals=5"])
    assert not ps.run(run, tmp_path / "out.vtkhdf", bless=True).passed
    assert not (tmp_path / "right.vtkhdf").exists()


def test_references_that_do_not_fit(file, tmp_path) -> None:
    right = tmp_path / "right.vtkhdf"
    ps.run(ps.load(file), tmp_path / "out.vtkhdf", bless=True)
    other = ps.run(ps.load(file, ["output.every=5"]))
    assert "the reference has no frame at t = 0.05 s" in other.checks[0].message
    more = "particles.wall.layout.position=[[0, 100, 0], [0, 200, 0]]"
    lost = ps.run(ps.load(file, [more, "checks.1.equals=5"]))
    assert not lost.passed
    assert "the reference does not have particle 4 at t = 0 s" in lost.checks[0].message
    assert "nan" not in lost.checks[0].message
    with h5py.File(right, "r+") as opened:
        opened["VTKHDF/Points"][5, 0] = np.nan
    assert not ps.run(ps.load(file)).passed
    with pytest.raises(UsageError, match="does not hold speed"):
        ps.run(
            ps.load(file, ["checks.0.quantity='speed'", "checks.0.tolerance=1", "output.fields=['speed']"])
        )
    right.write_text("nothing")
    with pytest.raises(UsageError, match="no HDF5 file"):
        ps.run(ps.load(file))


LACKING = [
    (
        {"particles.balls.layout": {"type": "points", "position": [[0, 1, 0], [1, 2, 0]]}},
        "always",
        "the run does not have particle 3 of the reference at t = 0 s",
    ),
    ({"simulation.duration": 0.5}, "always", "the run has no frame, the reference has one at t = 0.75 s"),
    ({"simulation.duration": 0.5}, "end", "the run has no frame, the reference has one at t = 1 s"),
    ({"output.every": 50}, "always", "the run has no frame, the reference has one at t = 0.25 s"),
    ({"output.every": 50}, "end", None),
    ({"planes": [{"point": [0, -0.5, 0], "contact": "kill"}]}, "always", "does not have particle 0 of the"),
    ({"planes": [{"point": [0, 5, 0], "contact": "kill", "on": ["balls"]}]}, "end", "particles 0, 1, 2 of"),
]


@pytest.mark.parametrize(("change", "at", "message"), LACKING, ids=str)
def test_what_the_run_lacks_of_its_reference(file, tmp_path, change, at, message) -> None:
    ps.run(ps.load(file), tmp_path / "out.vtkhdf", bless=True)
    check = ps.run(ps.load(file, {**change, "checks.0.at": at}), threads=1).checks[0]
    assert check.passed is (message is None), check.message
    assert message is None or message in check.message


def test_a_reference_in_a_region_and_of_a_group(file, tmp_path) -> None:
    """Of a region, particles count that are in it here or there; of a group, only its own."""
    ps.run(ps.load(file), tmp_path / "out.vtkhdf", bless=True)
    killed = {"planes": [{"point": [0, -3, 0], "contact": "kill", "on": ["balls"]}]}  # 0 and 1 fall deeper

    def passes(**keys: Any) -> bool:
        changes = killed | {f"checks.0.{key}": value for key, value in keys.items()}
        return ps.run(ps.load(file, changes), threads=1).checks[0].passed

    below = {"type": "half_space", "point": [0, -3.1, 0], "normal": [0, -1, 0]}
    assert passes(region={**below, "normal": [0, 1, 0]})
    assert not passes(region=below)
    assert passes(group="wall")
    assert not passes(group="balls")
    file.write_text(file.read_text().replace('"wall"', '"block"'))
    with pytest.raises(UsageError, match="does not hold the group block"):
        ps.run(ps.load(file, {"checks.0.group": "block"}))


@pytest.mark.parametrize("place", ["../right.vtkhdf", "{}/right.vtkhdf", "way/right.vtkhdf"])
def test_bless_writes_beside_the_scenario_only(file, tmp_path, place) -> None:
    """Elsewhere a reference may lie, and is read."""
    folder = tmp_path / "deep"
    folder.mkdir()
    (folder / "way").symlink_to(tmp_path)
    deep = file.rename(folder / file.name)
    with pytest.raises(UsageError, match="not in the scenario's folder"):
        ps.run(
            ps.load(deep, {"checks.0.reference": place.format(tmp_path)}), tmp_path / "out.vtkhdf", bless=True
        )
    assert not (tmp_path / "right.vtkhdf").exists()
    ps.run(ps.load(deep), tmp_path / "out.vtkhdf", bless=True)
    (folder / "right.vtkhdf").rename(tmp_path / "right.vtkhdf")
    assert ps.run(ps.load(deep, {"checks.0.reference": place.format(tmp_path)})).passed


def test_bless_without_a_reference(tmp_path) -> None:
    with pytest.raises(UsageError, match="no check of the scenario has a reference"):
        ps.run(scenario(), tmp_path / "out.vtkhdf", bless=True)
    with pytest.raises(UsageError, match="no trajectory is written"):
        ps.run(scenario(REFERENCE), bless=True)
