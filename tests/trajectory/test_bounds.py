"""What is said before a run about the size of its trajectory, against the file."""

import pytest

import particlesim as ps
from particlesim.bounds import needs

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
