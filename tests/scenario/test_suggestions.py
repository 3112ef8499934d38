"""Suggestions lead to what is meant, or are not made."""

import re
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

import particlesim as ps
from particlesim.model.spelling import folded, near_miss
from particlesim.scenario.scenario import Scenario
from particlesim.scenario.text import typewalk
from particlesim.scenario.text.suggestions import ANYWHERE, THESAURUS, TOP, suggestion, thesaurus
from particlesim.scenario.text.vocabulary import vocabulary

BALL = """
[simulation]
duration = 1
dt = 0.01
[[particles]]
name = "ball"
radius = 0.1
layout = { type = "points", position = [[0, 0, 1]] }
"""


def hint(more: str) -> str:
    """The hint to the one mistake in a scenario with these lines."""
    with pytest.raises(ps.ScenarioError) as caught:
        ps.loads(BALL + more)
    (found,) = caught.value.diagnostics
    return found.hint or ""


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[[collisions]]", '[[interactions]] of type "contact"'),
        ("[[spheres]]", '[[particles]] with a "radius"'),
        ("[[planes]]\nstatic_friction = 0.3", '"friction" of [[planes]]'),
        ("[[planes]]\nrolling_friction = 0.3", 'of type "contact" is that of grains'),
        ("[[planes]]\nbelt_velocity = [1, 0, 0]", '"surface_velocity" of [[planes]]'),
        ("[[planes]]\nbounciness = 0.3", '"restitution" of [[planes]]'),
        ("[[planes]]\nelasticity = 0.3", '"restitution" of [[planes]]'),
        ("[[planes]]\nBounciness = 0.3", '"restitution" of [[planes]]'),
        ("[[colliders]]\ntype = 'sphere'\nradius = 1\nhollow = true", '"inside" = true'),
        ("[[colliders]]\ntype = 'ball'\nradius = 1", '"sphere"'),
        ("[[obstacles]]", "[[colliders]]"),
        ("[[planes]]\ncontact = 'reflect'", '"bounce"'),
        ("[[forces]]\ntype = 'nbody'", "what particles do to each other are [[interactions]]"),
        ("[[forces]]\ntype = 'n-body'", "what particles do to each other are [[interactions]]"),
        ("[[forces]]\ntype = 'wind'", 'the "flow" of a "drag"'),
        ("[[forces]]\ntype = 'static_frition'", '"friction" of [[planes]]'),
        ("[wind]", 'the "flow" of a "drag"'),
        ("[[cloth]]", '"cloth" is a type of layout of [[particles]]'),
        ("[[springs]]\non = 'ball'\nwithin = 1\nstiffness = 1\nk = 3", 'psim calls it "stiffness"'),
        ("[render.camera]\nposition = [0, 1, 2]", '"eye" is where the camera is'),
        ("[output]\ndt = 1", '"dt" belongs in [simulation]'),
        ("[[forces]]\ntype = 'gravity'\nviscosity = 1", 'of type "stokes_drag" or "drag"'),
        ("[[force]]\ntype = 'gravity'", 'did you mean "forces"?'),
        ("[[plane]]", 'did you mean "planes"?'),
        ("[[sources]]", "[[emitters]] are sources"),
        ("[[attractors]]", '"attractor" is a type of [[forces]]'),
        ("[[magnets]]", 'the force of a "field"'),
        ("[[charges]]", 'of type "coulomb"'),
        ("[[boids]]", '"flocking" is a type of [[interactions]]'),
        ("[[hinges]]", "[[joints]] hold rigid bodies together"),
        ("[[bodies]]\nshape = { type = 'cube', size = [1, 1, 1] }", 'psim calls it "box"'),
        ("[[interactions]]\ntype = 'contact'\nmodel = 'dem'", '"linear"'),
        ("[[interactions]]\ntype = 'gravity'\nG = 1", '"constant" of a "gravity"'),
        ("[[interactions]]\ntype = 'contact'\nyoungs_modulus = 1", 'did you mean "young_modulus"?'),
        ("[[contacts]]", '[[interactions]] of type "contact"'),
        ("[[forces]]\ntype = 'lift'", 'the force of a "field"'),
        ("[[planes]]\nmu = 0.3", '"friction" of [[planes]]'),
        ("[[springs]]\non = 'ball'\nwithin = 1\nstiffness = 1\nbreak = 3", '"break_strain" or "break_force"'),
    ],
)
def test_words_of_other_tools_lead_to_ours(more: str, said: str) -> None:
    assert said in hint(more)


@pytest.mark.parametrize(
    "more",
    ["[[boxes]]", "[[lines]]", "[[lifts]]", "[[planes]]\nlift = 1", "[[planes]]\nboid = 1"],
)
def test_short_words_are_not_taken_for_other_words(more: str) -> None:
    assert "did you mean" not in hint(more)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("pin = true", '"pinned" of [[particles]]'),
        ("detection = 'discrete'", '"detection" belongs in [[planes]]'),
        ("velocity = [1, 0, 0]", '"velocity" belongs in layout of [[particles]]'),
        ("integrator = 'verlet'", '"velocity_verlet" or "stormer_verlet"'),
        ("integrator = { method = 'leapfrog' }", '"velocity_verlet" or "stormer_verlet"'),
        ("seed = 3", '"seed" belongs in [simulation]'),
        ("fps = 3", '"fps" belongs in [output] or [render]'),
    ],
)
def test_words_lead_from_a_group_to_their_places(line: str, said: str) -> None:
    with pytest.raises(ps.ScenarioError, match=re.escape(said)):
        ps.loads(BALL.replace("radius = 0.1", line))


def test_a_group_is_no_point() -> None:
    said = hint('[[forces]]\ntype = "attractor"\nmass = 1\ncenter = "ball"')
    assert said == "'ball' begins at [0, 0, 1]; what goes with particles are springs: " + (
        '[[springs]] with between = ["ball", ...]'
    )
    assert hint('[[forces]]\ntype = "attractor"\nmass = 1\ncenter = "bal"') == ""


def test_no_overrides_are_none() -> None:
    assert ps.loads(BALL, None) == ps.loads(BALL, overrides=None) == ps.loads(BALL)


SECTIONS = [(address, word, said) for address, words in thesaurus().items() for word, said in words.items()]
NAMES = re.findall(r"`([^`]*)`", THESAURUS.read_text(encoding="utf-8"))
TABLES = re.findall(r"\[\[(\w+)\]\]|\[(\w+)\] (?:holds|says|is)", THESAURUS.read_text(encoding="utf-8"))


def test_the_thesaurus_speaks_of_what_there_is() -> None:
    assert set(NAMES[1:]) <= set(vocabulary(Scenario))  # the first is in the comment that explains them
    assert {name for pair in TABLES for name in pair if name} <= set(Scenario.model_fields)


def test_words_of_the_thesaurus_are_not_ours_at_their_place() -> None:
    """Once psim learns a word, the line that says it has none, or calls it otherwise, is never read, or wrong."""
    ours = {folded(word): word for word in vocabulary(Scenario)}
    for address, word, _ in SECTIONS:
        if address == ANYWHERE:
            assert word not in ours, f"psim has {ours[word]}: take it out of [{ANYWHERE}]"
            continue
        kind = typewalk.node(Scenario)
        for step in () if address == TOP or address.startswith("*") else address.split("."):
            while kind.is_list:
                kind = typewalk.child(kind, 0, None) or kind
            kind = typewalk.child(kind, step, None) or kind
        assert kind.model is None or word not in map(folded, typewalk.fields(kind.model)), (address, word)
        if kind.is_union:
            assert word not in map(folded, typewalk.tags(kind)), (address, word)


def test_a_word_of_psim_is_never_taken_for_another_one() -> None:
    for word, table in product(vocabulary(Scenario), ("simulation", "output", "render")):
        known = list(typewalk.fields(Scenario.model_fields[table].annotation))  # type: ignore[arg-type]
        said = suggestion(word, known, (table,), Scenario, key=True)
        if word not in known and said is not None and said.startswith("did you mean"):
            assert said in (f'did you mean "{word}s"?', f'did you mean "{word.removesuffix("s")}"?')


@pytest.mark.parametrize(
    ("word", "known", "near"),
    [
        ("restituton", ["tangential_loss", "restitution"], "restitution"),
        ("Restitution", ["restitution"], "restitution"),
        ("color-by", ["color_by", "colors"], "color_by"),
        ("lfet", ["right", "left"], "left"),
        ("coef", ["normal", "coefficient"], "coefficient"),
        ("dT", ["dt"], "dt"),
        ("dx", ["dt"], None),
        ("dtt", ["dt"], "dt"),
        ("fvo", ["fov"], "fov"),
        ("aer", ["air"], "air"),
        ("rk5", ["rk4"], "rk4"),
        ("fo", ["fov"], None),
        ("foo", ["fov"], None),
        ("collisions", ["motions", "springs"], None),
        ("friction", ["restitution"], None),
        ("spheres", ["springs"], None),
        ("re", ["restitution"], None),
        ("res", ["restitution", "resolution"], None),
        ("", ["a"], None),
        ("q" * 10_000, ["a"], None),
    ],
)
def test_only_near_misses_are_taken_for_slips(word: str, known: list[str], near: str | None) -> None:
    assert near_miss(word, known) == near


@given(st.text(alphabet="abcde_", min_size=7, max_size=20), st.data())
def test_one_slip_in_a_long_word_is_seen(name: str, data: st.DataObject) -> None:
    if len(folded(name)) < 7:
        return
    at = data.draw(st.integers(0, len(name) - 1))
    slips = [name[:at] + name[at + 1 :], name[:at] + "z" + name[at:], name[:at] + "z" + name[at + 1 :]]
    slips.append(name[:at] + name[at : at + 2][::-1] + name[at + 2 :])
    for slip in slips:
        assert near_miss(slip, ["zzzzzzz", name]) == name
