"""Random valid scenarios survive load → dump → load, to the last bit of every number."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

import particlesim as ps
from particlesim.scenario.dump import dump

Table = dict[str, Any]


def numbers(low: float = -1e6, high: float = 1e6) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


positive = st.floats(1e-9, 1e9)
vectors = st.lists(numbers(), min_size=3, max_size=3)
axes = st.lists(st.floats(0.1, 10), min_size=3, max_size=3)
fractions = st.floats(0, 1)


def tables(required: Table, optional: Table | None = None) -> st.SearchStrategy[Table]:
    """Tables with some of the optional keys; a plain value stands for itself."""

    def strategy(value: Any) -> Any:
        return value if isinstance(value, st.SearchStrategy) else st.just(value)

    return st.fixed_dictionaries(
        {key: strategy(value) for key, value in required.items()},
        optional={key: strategy(value) for key, value in (optional or {}).items()},
    )


def sampled(values: st.SearchStrategy[float]) -> st.SearchStrategy[Any]:
    """A number, or a distribution of positive numbers."""
    pair = st.tuples(positive, positive).map(sorted)
    return (
        values
        | pair.map(lambda ab: {"type": "uniform", "low": ab[0], "high": ab[1]})
        | tables(
            {"type": "normal", "mean": positive, "std": positive, "min": 1e-9}, {"max": st.floats(1, 1e9)}
        )
        | tables({"type": "lognormal", "median": positive, "sigma": fractions})
        | tables({"type": "exponential", "mean": positive})
        | tables({"type": "choice", "values": st.lists(positive, min_size=1, max_size=3)})
    )


shapes = (
    tables({"type": "point", "position": vectors})
    | tables({"type": "box", "min": vectors, "max": st.just([2e6, 2e6, 2e6])})
    | tables({"type": "ball", "radius": positive}, {"center": vectors})
    | tables({"type": "sphere", "radius": positive}, {"center": vectors})
    | tables({"type": "disc", "radius": positive}, {"center": vectors, "normal": axes})
    | tables({"type": "shell", "inner": fractions, "outer": st.floats(1, 9)}, {"center": vectors})
)
layouts = (
    tables(
        {"type": "points", "position": st.lists(vectors, min_size=1, max_size=3)},
        {"velocity": st.lists(vectors, min_size=1, max_size=1)},
    )
    | tables(
        {"type": "random", "count": st.integers(1, 10**6), "shape": shapes},
        {"velocity": st.lists(sampled(numbers()), min_size=3, max_size=3)},
    )
    | tables(
        {
            "type": "lattice",
            "counts": st.lists(st.integers(1, 50), min_size=3, max_size=3),
            "spacing": positive | axes,
        },
        {"origin": vectors, "jitter": fractions},
    )
)
flows = st.lists(
    tables({"type": "uniform", "velocity": vectors})
    | tables(
        {"type": "vortex", "circulation": numbers(), "core_radius": positive},
        {"center": vectors, "axis": axes, "profile": st.sampled_from(["rankine", "lamb_oseen"])},
    ),
    min_size=1,
    max_size=2,
)
methods = st.sampled_from(["symplectic_euler", "rk4", "stormer_verlet", "yoshida4"])
sizes = st.sampled_from([("mass", "radius"), ("mass", "density"), ("radius", "density")]).flatmap(
    lambda names: tables({name: positive if name == "density" else sampled(positive) for name in names})
)
warmth = tables(
    {"temperature": sampled(positive)},
    {"cooling": tables({"rate": fractions}, {"ambient": st.floats(0, 400)})},
)
dynamics = (
    tables({"type": "second_order"})
    | tables({"type": "first_order", "drag": positive}, {"flow": flows})
    | tables({"type": "tracer", "flow": flows})
)


def group(head: st.SearchStrategy[Table]) -> st.SearchStrategy[Table]:
    """A group: what is its own, a size, a temperature, its dynamics."""
    rest = tables({}, {"dynamics": dynamics, "integrator": methods})
    return st.tuples(head, sizes, warmth, rest).map(
        lambda parts: {k: v for part in parts for k, v in part.items()}
    )


particles = group(tables({"layout": layouts}, {"pinned": st.booleans() | st.just([0])}))
emitters = group(
    tables(
        {"shape": shapes, "rate": st.floats(10, 1e4)},
        {
            "burst": tables({"count": st.integers(1, 99), "at": fractions})
            | st.lists(tables({"count": st.integers(1, 99), "at": fractions}), min_size=1, max_size=2),
            "stop": st.floats(0.5, 2),
            "timing": st.sampled_from(["regular", "jittered"]),
            "direction": axes | st.just("outward"),
            "spread": st.floats(0, 180),
            "speed": sampled(numbers()),
            "lifetime": sampled(positive),
            "die": tables({"outside": st.just([[-1, -1, -1], [1, 2, 3]])}),
            "limit": st.integers(1, 10**6),
        },
    )
)
forces = (
    tables({"type": "gravity"}, {"acceleration": vectors})
    | tables({"type": "linear_drag", "coefficient": fractions}, {"flow": flows})
    | tables(
        {"type": "stokes_drag", "fluid": st.sampled_from(["water", "glycerol", "pitch"])}, {"flow": flows}
    )
    | tables(
        {"type": "drag", "fluid": "air"},
        {"coefficient": fractions | st.just("schiller_naumann"), "area": positive},
    )
    | tables(
        {
            "type": "drag",
            "density": positive
            | tables({"type": "standard_atmosphere"}, {"sea_level": numbers(), "humidity": fractions}),
        }
    )
    | tables({"type": "buoyancy", "density": positive}, {"surface": numbers()})
    | tables({"type": "point_spring", "stiffness": positive}, {"anchor": vectors})
    | tables(
        {"type": "attractor", "strength": numbers()}, {"exponent": st.floats(-3, 5), "softening": fractions}
    )
    | tables(
        {"type": "rotating_frame", "angular_velocity": vectors},
        {"angular_acceleration": vectors, "center": vectors},
    )
    | tables({"type": "field", "force": ["-k*x", "sin(t)", "m*vz"], "constants": tables({"k": numbers()})})
    | tables({"type": "field", "potential": "x**2 + y"})
)
planes = tables(
    {"point": vectors, "normal": axes},
    {
        "restitution": fractions,
        "tangential_loss": fractions,
        "detection": st.sampled_from(["continuous", "discrete"]),
    },
) | tables({"contact": st.sampled_from(["stick", "kill"])})
impulses = tables({"at": fractions | st.lists(fractions, min_size=1, max_size=3), "impulse": vectors})


def named(prefix: str, entries: st.SearchStrategy[Table], most: int) -> st.SearchStrategy[list[Table]]:
    """A list of tables, each with a name of its own."""
    return st.lists(entries, max_size=most).map(
        lambda found: [{**entry, "name": f"{prefix}{k}"} for k, entry in enumerate(found)]
    )


@st.composite
def scenarios(draw: st.DrawFn) -> Table:
    """A scenario of 2 s in steps of 1/128 s, with frames every 1/16 s: what acts names nobody, so it acts where it can."""
    groups = [{**draw(particles), "name": "first"}, *draw(named("p", particles, 2))]
    table: Table = {
        "format": 1,
        "title": draw(st.text(st.characters(exclude_categories=("Cc", "Cf", "Cs", "Zl", "Zp")), max_size=30)),
        "simulation": {
            "duration": 2.0,
            **draw(st.sampled_from([{"dt": 2.0**-7}, {"substeps": 3}])),
            **draw(
                tables(
                    {},
                    {"seed": st.integers(0, 2**63 - 1), "precision": st.sampled_from(["single", "double"])},
                )
            ),
        },
        "output": {"interval": 2.0**-4, **draw(tables({}, {"ledger": st.booleans()}))},
        "particles": groups,
        "emitters": draw(named("e", emitters, 2)),
        "forces": draw(named("f", forces, 3)),
        "planes": draw(named("q", planes, 3)),
        "impulses": draw(named("j", impulses, 2)),
    }
    groups = [*table["particles"], *table["emitters"]]
    if all(group.get("dynamics", {}).get("type", "second_order") != "second_order" for group in groups):
        table["impulses"] = []  # there must be someone to kick
    return table


@given(scenarios(), st.booleans())
def test_scenarios_survive_dump_and_load(table: Table, defaults: bool) -> None:
    scenario = ps.from_table(table)
    text = dump(scenario, defaults=defaults)
    again = ps.loads(text)
    assert again == scenario
    assert dump(again, defaults=defaults) == text
