"""What a user reads about a wrong scenario: the message, the place under the caret, what is allowed."""

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

import particlesim as ps
from particlesim.errors import Diagnostic, ScenarioError
from particlesim.model.mistakes import Invalid
from particlesim.scenario.tables import Tables
from particlesim.scenario.text.diagnose import MOST_SHOWN, scenario_error
from particlesim.scenario.text.overrides import apply_overrides, override_from_python, parse_override
from particlesim.scenario.text.source import parse_source, source_from_dict
from particlesim.scenario.text.typewalk import branches, child, choose, fields, node

from .toy import GOOD, Scenario, load


def mistakes(old: str, new: str) -> tuple[Diagnostic, ...]:
    """What is wrong with the good scenario once `old` is replaced by `new`."""
    assert GOOD.count(old) == 1
    with pytest.raises(ScenarioError) as caught:
        load(GOOD.replace(old, new))
    return caught.value.diagnostics


def marked(diagnostic: Diagnostic) -> str:
    """The text that the carets underline."""
    span = diagnostic.span
    assert span is not None
    return diagnostic.source.split("\n")[span.line - 1][span.column - 1 :][: span.length]


def test_the_good_scenario_loads() -> None:
    scenario = load(GOOD)
    assert scenario.simulation.duration == 2.0
    assert scenario.particles[0].mass == 0.145


NORMAL = '{ type = "normal", mean = "90 km/h", std = 0.4 }'


@dataclass(frozen=True)
class Case:
    """A change to the good scenario, and what is said about it; `under` is the text above the carets."""

    old: str
    new: str
    message: str
    path: str
    under: str
    allowed: str | None = None
    hint: str | None = None


CASES = (
    Case(
        "0.47",
        "-1",
        "must be greater than 0, got -1",
        "forces.air.coefficient",
        "-1",
        allowed="a number > 0, in kg/s",
    ),
    Case(
        '"145 g"',
        '"-145 g"',
        'must be greater than 0, got "-145 g"',
        "particles.ball.mass",
        '"-145 g"',
        allowed="a number > 0, in kg",
    ),
    Case(
        '"drag"',
        '"darg"',
        'unknown type "darg"',
        "forces.air.type",
        '"darg"',
        allowed='"gravity", "drag", "field"',
        hint='did you mean "drag"?',
    ),
    Case(
        'type = "gravity"',
        "",
        "missing key 'type'",
        "forces.0",
        "[[forces]]",
        allowed='"gravity", "drag", "field"',
    ),
    Case('name = "ball"\n', "", "missing key 'name'", "particles.0.name", "[[particles]]", allowed="text"),
    Case(
        '"gravity"',
        '"gravity"\nacceleration = [0, 1]',
        "expected 3 elements, got 2",
        "forces.gravity.acceleration",
        "[0, 1]",
        allowed="a list of 3, each one an acceleration, in m/s^2",
    ),
    Case(
        'type = "normal", ',
        "",
        "missing key 'type'",
        "particles.ball.speed",
        '{ mean = "90 km/h", std = 0.4 }',
        allowed='"normal", "uniform"',
    ),
    Case(
        '"normal"',
        '"nromal"',
        'unknown type "nromal"',
        "particles.ball.speed.type",
        '"nromal"',
        allowed='"normal", "uniform"',
        hint='did you mean "normal"?',
    ),
    Case(
        "std = 0.4",
        "std = -1",
        "must be at least 0, got -1",
        "particles.ball.speed.std",
        "-1",
        allowed="a number ≥ 0, in m/s",
    ),
    Case(
        '"90 km/h"',
        '"90 kg"',
        'expected a velocity such as 0.5 or "90 km/h", got "90 kg" (mass)',
        "particles.ball.speed.mean",
        '"90 kg"',
    ),
    Case(
        NORMAL,
        '"fast"',
        'expected a velocity such as 0.5 or "90 km/h", got "fast"',
        "particles.ball.speed",
        '"fast"',
    ),
    Case(
        NORMAL,
        "true",
        'expected a velocity or a table with type = "normal" or "uniform", got true',
        "particles.ball.speed",
        "true",
    ),
    Case(
        "dt = 0.002",
        'integrator = "rk5"',
        'unknown value "rk5"',
        "simulation.integrator",
        '"rk5"',
        allowed='"symplectic_euler", "rk4"',
        hint='did you mean "rk4"?',
    ),
    Case(
        "dt = 0.002",
        'integrator = { method = "rk46" }',
        'unknown value "rk46"',
        "simulation.integrator.method",
        '"rk46"',
        allowed='"rk45"',
        hint='did you mean "rk45"?',
    ),
    Case(
        "dt = 0.002",
        "integrator = 3",
        'expected "symplectic_euler" or "rk4" or a table, got 3',
        "simulation.integrator",
        "3",
        allowed='"symplectic_euler" or "rk4"; or a table with method, and if need be tolerance',
    ),
    Case(
        "dt = 0.002",
        "dt = nan",
        "must be finite, got nan",
        "simulation.dt",
        "nan",
        allowed="a number > 0, in s",
    ),
    Case(
        "dt = 0.002",
        "dt = -inf",
        "must be finite, got -inf",
        "simulation.dt",
        "-inf",
        allowed="a number > 0, in s",
    ),
    Case("dt = 0.002", "seed = 0.5", "expected a whole number, got 0.5", "simulation.seed", "0.5"),
    Case(
        '["ball"]',
        '"ball"',
        'expected a list, got "ball"',
        "forces.air.on",
        '"ball"',
        allowed="a list, each one text",
        hint='a list of one: ["ball"]',
    ),
    Case('["ball"]', '["bal"]', "no group is called 'bal'", "forces.air.on.0", '"bal"'),
    Case(
        '"12 cm", 0',
        '"12 cm", 0, 0',
        "must have at most 3 elements, got 4",
        "particles.ball.layout.position.0",
        '[0, "12 cm", 0, 0]',
        allowed="a list of 3, each one a length, in m",
    ),
    Case(
        'type = "gravity"',
        'type = "field"\nforce = ["x", "1+a__b", "3"]',
        "names have no underscores",
        "forces.field.force.1",
        "__",
    ),
)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.new[:30])
def test_one_mistake(case: Case) -> None:
    (found,) = mistakes(case.old, case.new)
    assert found.message == case.message
    assert found.path == case.path
    assert marked(found) == case.under
    assert found.allowed == case.allowed
    assert found.hint == case.hint


def test_misspelt_key_is_marked_at_the_key() -> None:
    missing, unknown = mistakes("coefficient", "coeficient")
    assert missing.message == "missing key 'coefficient'"
    assert marked(missing) == "[[forces]]"
    assert missing.span is not None
    assert missing.span.line == 16  # the header of its own table, the second [[forces]]
    assert unknown.message == "unknown key 'coeficient'"
    assert unknown.hint == 'did you mean "coefficient"?'
    assert unknown.allowed == "type, name, coefficient, on"
    assert marked(unknown) == "coeficient"


REFUSED = [
    (
        "bodies",
        {"shape": {"type": "sphere", "radius": 1}},
        {
            "radius": 1,
            "springs": {"structural": 1},
            "integrator": "rk4",
            "cooling": {"rate": 1},
            "pinned": True,
            "dynamics": {"type": "tracer", "flow": [{"type": "uniform", "velocity": [1, 0, 0]}]},
        },
    ),
    ("interactions", {"type": "contact", "model": "impulse"}, {"cutoff": 1, "shift": "energy"}),
    ("interactions", {"type": "flocking", "sight": 1}, {"shift": "energy"}),
    ("interactions", {"type": "friction", "coefficient": 1, "range": 1}, {"shift": "energy"}),
]


def test_keys_that_are_always_refused_are_not_among_those_allowed() -> None:
    def told(table: str, entry: dict[str, object]) -> ScenarioError:
        grains = {"name": "g", "radius": 1, "layout": {"type": "points", "position": [[0, 0, 0]]}}
        start = {"simulation": {"duration": 1, "dt": 0.1}, "particles": [grains]}
        with pytest.raises(ScenarioError) as caught:
            ps.from_table({**start, table: [entry]})
        return caught.value

    models = []
    for table, entry, refused in REFUSED:
        model = child(child(node(Tables), table, []), 0, entry)
        model = choose(model, entry) if model.is_union else model
        assert set(refused) == set(model.model.unused)
        models.append(model.model)
        (unknown,) = told(table, {**entry, "foo": 1}).diagnostics
        assert unknown.allowed is not None
        assert not set(refused) & set(unknown.allowed.split(", "))
        for key, value in refused.items():
            assert any(key in found.path for found in told(table, {**entry, key: value}).diagnostics)
    # no other table refuses keys of its base
    for table in fields(Tables):
        kind = child(node(Tables), table, [])
        kind = child(kind, 0, [{}]) if kind is not None and kind.is_list else kind
        for branch in () if kind is None else branches(kind) if kind.is_union else [kind]:
            assert branch.model in models or not getattr(branch.model, "unused", ())


@pytest.mark.parametrize("key", ["mass", "radius", "temperature", "charge"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), "a", True, {"type": "normal"}, [1, "a"], []])
def test_one_mistake_is_told_once(key: str, value: object) -> None:
    # What may be a number, a list or a table of many types is a union, of which each branch complains.
    table = {
        "simulation": {"duration": 1, "dt": 0.1},
        "particles": [{"name": "a", "layout": {"type": "points", "position": [[0, 0, 0]]}, key: value}],
        "emitters": [
            {
                "name": "b",
                "rate": 1,
                "shape": {"type": "point", "position": [0, 0, 0]},
                "direction": [0, 1, 0],
                "speed": 1.0,
                key: value,
            }
        ],
    }
    with pytest.raises(ScenarioError) as caught:
        ps.from_table(table)
    paths = [found.path for found in caught.value.diagnostics]
    expected = 2 if isinstance(value, dict) else 1  # a normal distribution lacks both of its numbers
    for owner in ("particles.a", "emitters.b"):
        assert sum(path.startswith(f"{owner}.{key}") for path in paths) == expected, paths


@pytest.mark.parametrize(
    "anchor", [[0, 0, float("nan")], [[0, 0, float("nan")]], [0, "a", 0], [[0, 0, 0], 1]]
)
def test_one_mistake_in_a_place_or_in_a_list_of_places_is_told_once(anchor: list[object]) -> None:
    body = {"name": "a", "shape": {"type": "sphere", "radius": 0.1}}
    joint = {"type": "ball", "between": ["a", "world"], "anchor": anchor}
    with pytest.raises(ScenarioError) as caught:
        ps.from_table({"simulation": {"duration": 1, "dt": 0.1}, "bodies": [body], "joints": [joint]})
    assert len(caught.value.diagnostics) == 1, caught.value


def test_wrong_elements_do_not_make_a_list_too_short() -> None:
    found = mistakes('[[0, "12 cm", 0]]', "[7]")
    assert [(d.message, marked(d)) for d in found] == [("expected a list, got 7", "7")]


def test_names_have_an_alphabet() -> None:
    (found,) = mistakes('name = "ball"', 'name = "a b"')
    assert found.message == '"a b" has characters that may not stand here'
    assert found.allowed == "letters, digits, _ and -, not beginning with a digit"


def test_single_brackets_for_a_list_of_tables() -> None:
    (found,) = mistakes('[[forces]]\ntype = "gravity"\n\n[[forces]]', "[forces]")
    assert found.message == "expected a list, got a table"
    assert "[[name]]" in str(found.hint)


def test_cross_field_mistakes_mark_both_places() -> None:
    (found,) = mistakes(NORMAL, '{ type = "uniform", low = 3, high = 2.5 }')
    assert found.message == "low is above high"
    assert marked(found) == "3"
    (label,) = found.labels
    assert label.text == "the upper end"
    assert found.source.split("\n")[label.span.line - 1][label.span.column - 1 :].startswith("2.5")
    assert found.hint == "swap the two"


def test_several_mistakes_stand_in_the_order_of_the_file() -> None:
    found = mistakes("dt = 0.002", 'dt = 0\nprecision = "doubel"\nseed = "x"')
    assert [d.path for d in found] == ["simulation.dt", "simulation.precision", "simulation.seed"]


def test_many_mistakes_are_cut() -> None:
    with pytest.raises(ScenarioError) as caught:
        load(GOOD + "".join(f"[unknown_{i}]\n" for i in range(MOST_SHOWN + 7)))
    assert len(caught.value.diagnostics) == MOST_SHOWN + 1
    assert caught.value.diagnostics[-1].message == "and 7 more mistakes"


@pytest.mark.parametrize(
    ("argument", "path", "under"),
    [
        ("forces.air.coefficient=-1", "forces.air.coefficient", "-1"),
        ("forces.gravity.acceleration=[0, 1, true]", "forces.gravity.acceleration.2", "true"),
        ("simulation.dtt=3", "simulation.dtt", "simulation.dtt"),
        ("render.look=3", "render", "render.look"),
        ("particles.0.layout={type='lattice', count=0}", "particles.ball.layout.count", "0"),
        ("particles.ball.layout={type='lattice'}", "particles.ball.layout.count", "{type='lattice'}"),
    ],
)
def test_overrides_are_shown_as_given(argument: str, path: str, under: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load(apply_overrides(parse_source(GOOD), [parse_override(argument)]))
    (found,) = caught.value.diagnostics
    assert found.source == f"--set {argument}"
    assert found.file is None
    assert found.path == path
    assert marked(found) == under


def test_overrides_from_python() -> None:
    override = override_from_python("particles.ball.speed", {"type": "normal", "mean": 1, "std": -2.0})
    with pytest.raises(ScenarioError) as caught:
        load(apply_overrides(parse_source(GOOD), [override]))
    (found,) = caught.value.diagnostics
    assert found.source == 'override particles.ball.speed = { type = "normal", mean = 1, std = -2.0 }'
    assert marked(found) == "-2.0"


def test_a_second_place_in_another_text_is_told_in_words() -> None:
    text = GOOD.replace(NORMAL, '{ type = "uniform", low = 3, high = 4 }')
    with pytest.raises(ScenarioError) as caught:
        load(apply_overrides(parse_source(text), [parse_override("particles.ball.speed.low=5")]))
    (found,) = caught.value.diagnostics
    assert marked(found) == "5"
    assert found.hint == "swap the two; particles.ball.speed.high: the upper end"


def test_mistakes_found_after_validation() -> None:
    error = scenario_error(
        parse_source(GOOD),
        [
            Invalid("on must not be empty", ("forces", 1, "on")),
            Invalid(
                "duration is no multiple of dt", ("simulation", "duration"), ((("simulation", "dt"), "dt"),)
            ),
        ],
    )
    assert [d.path for d in error.diagnostics] == ["simulation.duration", "forces.air.on"]
    assert len(error.diagnostics[0].labels) == 1


def test_python_data_has_no_places() -> None:
    with pytest.raises(ScenarioError) as caught:
        load(source_from_dict({"simulation": {"duration": -1}}))
    (found,) = caught.value.diagnostics
    assert found.path == "simulation.duration"
    assert found.span is None


hostile = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just("normal"),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(
                ["type", "name", "layout", "position", "speed", "mean", "on", "force", "dt", "x", ""]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@given(st.dictionaries(st.sampled_from([*Scenario.model_fields, "x"]), hostile, max_size=4))
def test_any_data_gives_a_scenario_or_a_scenario_error(raw: dict[str, object]) -> None:
    try:
        load(source_from_dict(raw))
    except ScenarioError as error:
        assert error.diagnostics  # noqa: PT017
        assert "function-" not in str(error)  # noqa: PT017
        assert "Input should" not in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("format=2", "unknown value 2 (allowed: 1)"),
        ("simulation.duraton=1", 'did you mean "duration"?'),
        ("simulation.seed=1e3", "write 1000"),
        ("simulation.seed=-1", "(allowed: a whole number ≥ 0 and ≤ 9223372036854775807)"),
        ("particles.ball.layout.position=[0, 1, 0]", "write [[0, 1, 0]]"),
        ("forces.gravity.acceleration=-9.81", "a vector has three components: [0, -9.81, 0]"),
        ("impulses=[{at=[], impulse=[1, 0, 0]}]", "must have at least 1 element, got 0"),
        ("render.size=[8, 48]", "(allowed: a whole number ≥ 16 and ≤ 8192)"),
    ],
)
def test_slips_get_the_advice_that_mends_them(setting, words):
    text = """\
simulation = { duration = 1, dt = 0.1 }
particles = [{ name = "ball", layout = { type = "points", position = [[0, 1, 0]] } }]
forces = [{ type = "gravity" }]
"""
    with pytest.raises(ScenarioError) as caught:
        ps.loads(text, [setting])
    assert words in str(caught.value)
    assert len(caught.value.diagnostics) == 1


def test_the_file_of_a_sweep_is_no_scenario(tmp_path) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text('scenario = "fountain.toml"\n[vary]\n"simulation.dt" = [0.1, 0.2]\n')
    with pytest.raises(ps.UsageError, match="is a sweep, not a scenario") as caught:
        ps.load(file)
    assert "psim sweep" in str(caught.value.hint)
