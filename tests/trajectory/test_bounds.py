"""What is said before a run about the size of its trajectory and its memory, against the file and the process."""

import json
import subprocess
import sys

import pytest

import particlesim as ps
from particlesim.engine.simulation import Simulation
from particlesim.preflight.pair_memory import held, pair_bytes
from particlesim.preflight.resources import needs

FALL = {
    "simulation": {"duration": 1.0, "dt": 0.01},
    "particles": [
        {
            "name": "dust",
            "layout": {
                "type": "random",
                "count": 3000,
                "shape": {"type": "box", "min": [0, 0, 0], "max": [1, 1, 1]},
            },
            "mass": 0.1,
        }
    ],
    "emitters": [
        {
            "name": "drops",
            "rate": 2000,
            "shape": {"type": "disc", "center": [0, 0, 0], "radius": 0.2, "normal": [0, 1, 0]},
            "direction": [0, 1, 0],
            "speed": 5.0,
            "lifetime": 0.4,
            "mass": 0.01,
        }
    ],
    "forces": [{"type": "gravity"}],
}


@pytest.mark.parametrize("every", [1, 20])
def test_size_of_a_trajectory(tmp_path, every):
    """Uncompressed, sizes are known to the chunk; compressed ones are bounded from above."""
    for compression in ("none", "gzip"):
        output = {"every": every, "compression": compression}
        scenario = ps.from_table({**FALL, "output": output})
        path = tmp_path / f"{compression}.vtkhdf"
        ps.run(scenario, path)
        said, size = needs(scenario).disk, path.stat().st_size
        if compression == "none":
            assert said == pytest.approx(size, rel=0.06)
        else:
            assert size <= said <= 2 * size


PEAK = """
import json, sys
import particlesim as ps
from particlesim.preflight.resources import needs
table, output = json.loads(sys.argv[1]), sys.argv[2] or None
scenario = ps.from_table(table)
ps.run(scenario, output, checkpoint_wall=1e-3)
# Not ru_maxrss, which begins with that of the process that started this one.
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(needs(scenario, recorded=output is not None).memory, int(peak.split()[1]) * 1024)
"""


@pytest.mark.parametrize(
    ("law", "box", "most"),
    [
        ({"type": "gravity", "method": "tree"}, None, 1.1),
        ({"type": "soft_sphere", "epsilon": 1, "sigma": 0.05, "cutoff": 0.12}, [1, 1, 1], 1.6),
        # while a plan is looked for, there are two
        ({"type": "gravity", "softening": 1e-3}, [1, 1, 1], 2.5),
    ],
)
def test_memory_of_pairs(law, box, most):
    """What is said of interactions holds the arrays that they have, and is not much more."""
    shape = {"type": "box", "min": [0, 0, 0], "max": [1, 1, 1]}
    table = {
        "simulation": {"duration": 1, "dt": 1, **({"box": {"size": box}} if box else {})},
        "particles": [
            {"name": "a", "mass": 1, "layout": {"type": "random", "count": 20_000, "shape": shape}}
        ],
        "interactions": [law],
    }
    many = {**table["simulation"], "dt": 0.01}
    scenario = ps.from_table(table)
    simulation = Simulation(scenario)
    (each,) = simulation.islands[0].interactions
    said, there = pair_bytes(scenario, {"a": 20_000}, 8), held(tuple(each))
    assert 0.9 * there < said < most * there
    assert needs(scenario).memory > said
    # Lists of many particles are gone through in another order for many steps: in copies.
    copies = [
        needs(ps.from_table(table | {"output": {"every": n}, "simulation": many})).memory for n in (1, 100)
    ]
    state = 8 * 7 * 20_000
    assert (copies[1] - copies[0] > state) == (law["type"] == "soft_sphere")
    simulation.close()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the peak of memory")
@pytest.mark.parametrize("recorded", [pytest.param(False, marks=pytest.mark.slow), True])
def test_memory_of_a_run(tmp_path, recorded):
    """Of two runs, so that neither the libraries nor compiling counts: as much more as there are more particles."""
    found = []
    for count in (10_000, 10_000, 1_010_000):  # the first one compiles
        layout = {**FALL["particles"][0]["layout"], "count": count}
        table = {
            "simulation": {"duration": 0.1, "dt": 0.01},
            "output": {"every": 2},
            "particles": [{**FALL["particles"][0], "layout": layout}],
            "forces": FALL["forces"],
        }
        output = str(tmp_path / f"{len(found)}.vtkhdf") if recorded else ""
        command = [sys.executable, "-c", PEAK, json.dumps(table), output]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        found.append([int(word) for word in done.stdout.split()])
    said, used = (found[2][k] - found[1][k] for k in (0, 1))
    assert 0.95 * used <= said <= 1.2 * used
