"""Forces and flows of installed packages are as psim's own, and what is wrong with a package is told by its name."""

from __future__ import annotations

import json
import math
import os
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from jsonschema import Draft7Validator

import particlesim as ps
from particlesim.errors import ScenarioError, UsageError
from particlesim.extensions import packages
from particlesim.scenario.dump import dump
from particlesim.scenario.extensions import find_all
from particlesim.scenario.schema import json_schema
from particlesim.scenario.text.source import parse_source
from particlesim.testing import check_interaction
from particlesim.verification.rerun import rerun
from psim.app import app

from .conftest import AXIS_PULL, SCENARIO, forget, write_package

REPOSITORY = Path(__file__).resolve().parents[2]
BUILT_IN = SCENARIO.replace('"axis_pull"\npull = "2 N"', '"gravity"')
ENTRIES = "[particlesim.forces]\naxis_pull = axis_forces:AxisPull\n"


Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def psim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """Run `psim ARGUMENTS` in this process, in an empty folder: its exit code, and what it says on stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        forget()
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            app(list(map(str, arguments)), prog_name="psim")
        return int(end.value.code or 0), *capsys.readouterr()

    return run


def own_process(program: str, folder: Path) -> str:
    """What a Python program prints that finds this checkout and the packages of the test."""
    path = os.pathsep.join([str(REPOSITORY), str(REPOSITORY / "cli"), os.environ["PYTHONPATH"]])
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def refusal(text: str) -> str:
    """What is said of a scenario that cannot be used."""
    with pytest.raises(ScenarioError) as error:
        ps.loads(text)
    return str(error.value)


# Forces and flows that work


def test_a_force_of_a_package_moves_particles(axis_forces: Path) -> None:
    result = ps.run(ps.loads(SCENARIO))
    # a = F/m = 4 m/s² towards the axis, for half a second
    x, z = result.final.position[0, 0], result.final.position[1, 2]
    assert x == pytest.approx(1 - 4 * 0.5**2 / 2, abs=0.02)
    assert z == pytest.approx(2 - 4 * 0.5**2 / 2, abs=0.02)
    # its potential is in the ledger
    assert result.energy[0] == pytest.approx(2 * (1 + 2))


def test_a_flow_of_a_package_carries_tracers(wind_models: Path) -> None:
    text = (
        SCENARIO[: SCENARIO.index("[[forces]]")].replace("[1, 0, 0]", "[0, 3, 0]").replace("mass = 0.5\n", "")
    )
    text += 'dynamics = { type = "tracer", flow = [{ type = "shear", rate = "2 1/s" }] }\n'
    assert ps.run(ps.loads(text)).final.position[0, 0] == pytest.approx(2 * 3 * 0.5)


def test_a_flow_of_a_package_within_a_force_of_psim(wind_models: Path) -> None:
    text = BUILT_IN.replace(
        '"gravity"', '"linear_drag"\ncoefficient = 1\nflow = [{ type = "shear", rate = 2 }]'
    )
    assert ps.loads(text).forces[0].flow[0].type == "shear"  # type: ignore[union-attr]
    assert "unknown key 'speed'" in refusal(text.replace("rate", "speed"))


def test_an_interaction_of_a_package_passes_the_checks(shell_models: Path) -> None:
    scenario = ps.loads(
        SCENARIO.split("[[forces]]")[0] + '[[interactions]]\ntype = "born_mayer"\nsize = 2.0\nrate = 0.5\n'
    )
    check_interaction(scenario.interactions[0])


def test_an_interaction_of_a_package_acts_between_particles(shell_models: Path) -> None:
    law = '[[interactions]]\ntype = "born_mayer"\nsize = 2.0\nrate = 0.5\n'
    scenario = ps.loads(SCENARIO.split("[[forces]]")[0] + law)
    result = ps.run(scenario)
    # at rest, √5 m apart: U = 2 e^(−√5/2), and what it loses becomes motion
    begin, end = (result.ledger["potential.born_mayer"][k] for k in (0, -1))
    assert begin == pytest.approx(2 * math.exp(-math.sqrt(5) / 2), rel=1e-14)
    assert result.ledger["kinetic"][-1] == pytest.approx(
        begin - end, rel=0.03
    )  # symplectic Euler is of first order
    assert end < begin


def test_implicit_methods_take_its_jacobians(axis_forces: Path) -> None:
    text = SCENARIO.replace("dt = 0.01", 'dt = 0.01\nintegrator = "implicit_midpoint"')
    assert ps.run(ps.loads(text)).final.position[0, 0] == pytest.approx(1 - 4 * 0.5**2 / 2, rel=1e-6)


def test_a_scenario_with_it_is_dumped_and_pickled(axis_forces: Path) -> None:
    scenario = ps.loads(SCENARIO)
    assert ps.loads(dump(scenario)) == scenario
    assert pickle.loads(pickle.dumps(scenario)) == scenario
    again = ps.Scenario(simulation=scenario.simulation, particles=scenario.particles, forces=scenario.forces)
    assert again == scenario


def test_mistakes_have_places_and_suggestions(axis_forces: Path) -> None:
    told = refusal(SCENARIO.replace("2 N", "2 kg"))
    assert "forces.axis_pull.pull" in told
    assert "in N" in told
    assert 'did you mean "pull"' in refusal(SCENARIO.replace("pull = ", "pul = "))
    with pytest.raises(ScenarioError) as error:
        ps.loads(SCENARIO.replace("axis_pull", "axis_pul"))
    (diagnostic,) = error.value.diagnostics
    assert diagnostic.span is not None
    assert (diagnostic.span.line, diagnostic.span.column) == (13, 8)
    assert '"axis_pull"' in str(diagnostic.allowed)
    assert diagnostic.hint == 'did you mean "axis_pull"?'


def test_the_schema_takes_it_once_it_is_known(axis_forces: Path) -> None:
    raw = parse_source(SCENARIO).raw
    assert find_all() == []
    schema = json_schema(ps.Scenario)
    assert Draft7Validator(schema).is_valid(raw)
    assert schema["definitions"]["AxisPull"]["properties"]["pull"]["description"] == "Size of the force F."
    forget()
    assert not Draft7Validator(json_schema(ps.Scenario)).is_valid(raw)


def test_the_schema_takes_forces_and_flows_together(axis_forces: Path, wind_models: Path) -> None:
    assert find_all() == []
    schema = Draft7Validator(json_schema(ps.Scenario))
    windy = (
        SCENARIO
        + '[[forces]]\ntype = "linear_drag"\ncoefficient = 1\nflow = [{ type = "shear", rate = 2 }]\n'
    )
    assert schema.is_valid(parse_source(windy).raw)
    assert not schema.is_valid(parse_source(windy.replace("rate", "speed")).raw)
    ps.loads(windy)


def test_psims_own_types_look_for_no_package(axis_forces: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(**_: object) -> None:
        raise AssertionError("looked for entry points")

    monkeypatch.setattr(packages.importlib.metadata, "entry_points", never)
    ps.run(ps.loads(BUILT_IN))
    assert "axis_forces" not in sys.modules


# The command


def test_the_command_knows_it(psim: Command, axis_forces: Path) -> None:
    Path("axis.toml").write_text(SCENARIO)
    assert "axis_pull" in psim("check", "axis.toml")[1]
    described = psim("describe", "axis_pull")[1]
    assert re.search(r"formula +f = −F ρ̂\n", described)
    assert re.search(r"package +axis-forces 1.2\n", described)
    assert "Size of the force F. (in N; required)" in described
    assert "axis_pull" in psim("describe")[1]
    assert Draft7Validator(json.loads(psim("schema")[1])).is_valid(parse_source(SCENARIO).raw)


def test_its_name_is_completed_without_an_import(axis_forces: Path) -> None:
    from psim.describe import _names

    assert _names("axis") == ["axis_pull"]
    assert "axis_forces" not in sys.modules


def test_help_and_version_look_at_no_package(axis_forces: Path, tmp_path: Path) -> None:
    program = (
        "import sys, importlib.metadata as m; m.entry_points = None; from psim.app import app\n"
        "for word in ('--help', '--version'):\n"
        "    try: app([word], prog_name='psim')\n"
        "    except SystemExit as end: assert not end.code\n"
        "assert not any(name.startswith('particlesim.extensions') for name in sys.modules)"
    )
    assert "psim" in own_process(program, tmp_path)


def test_sweeps_take_it_to_their_workers(psim: Command, axis_forces: Path) -> None:
    Path("axis.toml").write_text(SCENARIO)
    code, _, said = psim("sweep", "axis.toml", "--vary", "forces.axis_pull.pull=1,2", "--workers", 2)
    assert code == 0, said
    (table,) = Path().rglob("*.csv")
    assert table.read_text().count("done") == 2


def test_provenance_inspect_diff_and_rerun_tell_of_the_package(
    psim: Command, axis_forces: Path, tmp_path: Path
) -> None:
    first, second = tmp_path / "first.vtkhdf", tmp_path / "second.vtkhdf"
    ps.run(ps.loads(SCENARIO), first)
    with ps.open(first) as trajectory:
        assert trajectory.provenance["extensions"] == "axis_pull: axis-forces 1.2"
    assert re.search(r"extensions +axis_pull: axis-forces 1.2\n", psim("inspect", first)[1])
    assert rerun(first).same

    write_package(axis_forces, "axis-forces", "axis_forces", AXIS_PULL, ENTRIES, "1.3")
    forget()
    compared = rerun(first, second)
    assert compared.same
    assert "axis_pull: axis-forces 1.2 and axis-forces 1.3" in compared.notes

    write_package(axis_forces, "axis-forces", "axis_forces", AXIS_PULL, "", "1.3")
    forget()
    with pytest.raises(UsageError, match=r"needs 'axis_pull' of the package axis-forces 1\.2"):
        rerun(first)


def test_only_packages_in_use_are_recorded(axis_forces: Path, wind_models: Path, tmp_path: Path) -> None:
    ps.run(ps.loads(BUILT_IN), tmp_path / "own.vtkhdf")
    with ps.open(tmp_path / "own.vtkhdf") as trajectory:
        assert "extensions" not in trajectory.provenance


def test_a_run_is_not_resumed_with_another_version(axis_forces: Path, tmp_path: Path) -> None:
    output = tmp_path / "out.vtkhdf"
    ps.run(ps.loads(SCENARIO), output)
    write_package(axis_forces, "axis-forces", "axis_forces", AXIS_PULL, ENTRIES, "1.3")
    forget()
    with pytest.raises(UsageError, match=r"axis-forces 1\.2; now there are axis_pull: axis-forces 1\.3"):
        ps.run(ps.loads(SCENARIO), output, resume=True)


def test_kernels_are_compiled_anew_when_the_package_changes(axis_forces: Path, tmp_path: Path) -> None:
    (tmp_path / "axis.toml").write_text(SCENARIO)
    program = "import particlesim as ps; print(ps.run(ps.load('axis.toml')).final.position[0, 0])"
    assert float(own_process(program, tmp_path)) == pytest.approx(1 - 4 * 0.5**2 / 2, abs=0.03)
    half = AXIS_PULL.replace("k = -f.pull / np", "k = -0.5 * f.pull / np").replace(
        "return f.pull * np.sqrt", "return 0.5 * f.pull * np.sqrt"
    )
    write_package(axis_forces, "axis-forces", "axis_forces", half, ENTRIES)
    assert float(own_process(program, tmp_path)) == pytest.approx(1 - 2 * 0.5**2 / 2, abs=0.03)


# What can be wrong with a package

BROKEN = {
    "import": (f"import no_such_module\n{AXIS_PULL}", ENTRIES, "No module named 'no_such_module'"),
    "exit": ("raise SystemExit(3)", ENTRIES, "SystemExit: 3"),
    "syntax": ("def", ENTRIES, "SyntaxError"),
    "absent": (AXIS_PULL, ENTRIES.replace("AxisPull", "Pull"), "has no attribute 'Pull'"),
    "nonsense": (AXIS_PULL, ENTRIES.replace("axis_forces:AxisPull", "axis forces"), "cannot be imported"),
    "function": (AXIS_PULL, ENTRIES.replace("AxisPull", "axis_pull_dx"), "is no Force"),
    "other": (AXIS_PULL, ENTRIES.replace("AxisPull", "AxisPullRecord"), "is no Force"),
    "name": (AXIS_PULL.replace('"axis_pull"', '"pull"'), ENTRIES, "whose type is 'pull'"),
    "docstring": (
        AXIS_PULL.replace('    """A pull of the same size everywhere, towards the y axis."""\n', ""),
        ENTRIES,
        "it has no docstring",
    ),
    "formula": (re.sub("    formula: .*\n", "", AXIS_PULL), ENTRIES, "it has no formula"),
    "text": (AXIS_PULL.replace('    """Size of the force F."""\n', ""), ENTRIES, "pull has no text under it"),
    "unit": (AXIS_PULL.replace("Newtons, Ge(0)", "float, Ge(0)"), ENTRIES, "pull has no unit"),
    "no record": (re.sub("    def record.*\n.*\n", "", AXIS_PULL), ENTRIES, "NotImplementedError"),
    "a bare tuple": (AXIS_PULL.replace("return AxisPullRecord(self.pull)", "return (1.0,)"), ENTRIES, "not a NamedTuple"),
    "no law": (AXIS_PULL.replace("@law(force, AxisPullRecord)", ""), ENTRIES, "AxisPullRecord has no law for force"),
    "two numbers": (AXIS_PULL.replace("p.y - p.y, k * p.z", "k * p.z"), ENTRIES, "gives 2 numbers instead of 3"),
    "not for kernels": (AXIS_PULL.replace("k = -f.pull", "k = hash(p.y) - f.pull"), ENTRIES, "does not compile"),
    "own error": (AXIS_PULL.replace("return AxisPullRecord(self.pull)", "return 1 / 0"), ENTRIES, "ZeroDivisionError"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_package_is_named_where_it_is_used(case: str, site: Path) -> None:
    source, entries, told = BROKEN[case]
    write_package(site, "axis-forces", "axis_forces", source, entries)
    with pytest.raises(ScenarioError) as error:
        ps.loads(SCENARIO)
    (diagnostic,) = error.value.diagnostics
    assert "'axis_pull' of the package axis-forces 1.2" in diagnostic.message
    assert told in diagnostic.message
    assert diagnostic.span is not None
    assert (diagnostic.span.line, diagnostic.span.column) == (13, 8)
    ps.loads(BUILT_IN)  # others are not harmed


def test_a_broken_package_is_a_warning_where_it_is_not_used(psim: Command, site: Path) -> None:
    write_package(site, "axis-forces", "axis_forces", "raise ValueError('torn')", ENTRIES)
    Path("axis.toml").write_text(SCENARIO)
    Path("own.toml").write_text(BUILT_IN)
    code, out, said = psim("describe")
    assert code == 0
    assert "gravity" in out
    assert "warning: 'axis_pull' of the package axis-forces 1.2 cannot be imported" in said
    assert "torn" in said
    code, _, said = psim("check", "own.toml")
    assert code == 0
    assert "axis" not in said
    code, _, said = psim("run", "axis.toml")
    assert code == 2
    assert "axis.toml:13:8" in said
    assert "Traceback" not in said


def test_a_name_of_psim_stays_psims(site: Path) -> None:
    source = AXIS_PULL.replace('"axis_pull"', '"gravity"')
    write_package(site, "axis-forces", "axis_forces", source, ENTRIES.replace("axis_pull", "gravity"))
    assert type(ps.loads(BUILT_IN).forces[0]).__module__ == "particlesim.forces.gravity"
    (problem,) = find_all()
    assert problem == "'gravity' of the package axis-forces 1.2 is not used: psim has a type of this name"


def test_two_packages_with_one_name_are_told_apart_by_nobody(axis_forces: Path) -> None:
    write_package(
        axis_forces, "more-forces", "more_forces", AXIS_PULL, ENTRIES.replace("axis_f", "more_f"), "7"
    )
    assert "several packages, axis-forces 1.2 and more-forces 7" in refusal(SCENARIO)
    assert len(find_all()) == 1


# The checks for packages


def test_the_checks_of_packages_pass_and_fail(axis_forces: Path, wind_models: Path) -> None:
    import axis_forces as package  # type: ignore[import-not-found]
    import wind_models as winds  # type: ignore[import-not-found]

    from particlesim.testing import check_flow, check_force, particles

    check_force(package.AxisPull(pull=2.0))
    check_flow(winds.Shear(rate=2.0))
    assert all(math.isfinite(number) for p in particles(3) for number in p[:10])


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("return f.pull * np.sqrt", "return 2 * f.pull * np.sqrt", "F is not −∇U"),
        ("return -k * p.z * p.z", "return k * p.z * p.z", "force_dx is not the derivative of force by x y z"),
        ("return k * p.x, p.y - p.y", "return k * p.x, -p.vy", "override needs_velocity"),
        ("return ZERO_MATRIX", "return (1.0, *ZERO_MATRIX[1:])", "force_dv is not the derivative of force"),
        ("return k * p.x, p.y - p.y", "return k * p.x, 0 * p.vy", None),
        ("return k * p.x, p.y - p.y", "return k * p.x, p.r", "reads the radius"),
        ("return k * p.x, p.y - p.y", "return k * p.x, p.T", "reads the temperature"),
        ('"U = F ρ"', '"none: dissipative"', "but there is a law for potential"),
        ('    """Size of the force F."""\n', "", "pull has no text under it"),
    ],
)
def test_the_checks_find_mistakes(site: Path, old: str, new: str, told: str | None) -> None:
    import importlib

    from particlesim.testing import check_force

    assert old in AXIS_PULL
    write_package(site, "axis-forces", "axis_forces", AXIS_PULL.replace(old, new), ENTRIES)
    importlib.invalidate_caches()
    model = importlib.import_module("axis_forces").AxisPull(pull=2.0)
    if told is None:
        check_force(model)
        return
    with pytest.raises(AssertionError, match=told):
        check_force(model)
