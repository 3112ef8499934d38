"""Makes the track of `marble_run.toml`: a channel that goes straight down a ramp and around a helix, as a closed mesh.

python marble_run.py        # writes marble_run.ply beside it
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

SLOPE = np.radians(6.0)  # everywhere
RAMP, EXIT = 1.2, 0.3  # lengths over ground [m]
RADIUS, TURNS, RINGS = 0.5, 2.25, 360  # of the helix; rings of corners around it
INSIDE, WALL = 0.05, 0.008  # radius of the channel, and how thick it is [m]
OPEN = 110.0  # from the bottom of the channel to its rims [degrees]
FACETS = 17  # across the channel; odd, so that its bottom is flat
TOP = 1.5  # height of the bottom of the channel at its beginning [m]


def path() -> tuple[np.ndarray, np.ndarray]:
    """Places on the axis of the channel over ground and its directions there, shapes [n, 3]; heights are 0."""
    turn = np.linspace(0, 2 * np.pi * TURNS, RINGS + 1)
    x, z = RAMP + RADIUS * np.sin(turn), RADIUS * (1 - np.cos(turn))
    around = np.stack([x, 0 * x, z], axis=1)
    ahead = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    places = np.concatenate([[[0, 0, 0]], around, around[-1:] + EXIT * ahead[-1:]])
    return places, np.concatenate([ahead[:1], ahead, ahead[-1:]])


def section() -> np.ndarray:
    """Corners of the cross-section (sideways, up) about the axis of the channel, counterclockwise seen along it."""
    angle = np.radians(np.linspace(-OPEN, OPEN, FACETS + 1)) - np.pi / 2
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = np.cos(np.radians(OPEN / FACETS))  # the middles of facets are INSIDE from the axis
    outer = np.radians(np.linspace(-OPEN, OPEN, 9)) - np.pi / 2
    shell = np.stack([np.cos(outer), np.sin(outer)], axis=1)
    return np.concatenate(
        [(INSIDE + WALL) / np.cos(np.radians(OPEN / 8)) * shell, INSIDE / flat * ring[::-1]]
    )


def main() -> None:
    """Write the mesh."""
    places, ahead = path()
    gone = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    places[:, 1] = TOP + INSIDE - np.tan(SLOPE) * gone
    along = np.cos(SLOPE) * ahead - np.sin(SLOPE) * np.array([0, 1, 0])
    side = np.cross(ahead, [0, 1, 0])
    up = np.cross(side, along)
    across = section()
    corners = (
        places[:, None] + across[None, :, :1] * side[:, None] + across[None, :, 1:] * up[:, None]
    ).reshape(-1, 3)
    n, m = len(places), len(across)
    index = np.arange(n * m).reshape(n, m)
    a, b = index[:-1], np.roll(index[:-1], -1, axis=1)
    c, d = np.roll(index[1:], -1, axis=1), index[1:]
    faces = [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, c, b), (a, d, c))]
    # the ends of the channel: strips between its outside and its inside
    outer, inner = np.arange(9), np.arange(9, m)[::-1]
    near = np.minimum(np.arange(9) * FACETS // 8, FACETS)
    strip = []
    for k in range(8):
        strip.append((outer[k], outer[k + 1], inner[near[k]]))
        strip += [(inner[j], outer[k + 1], inner[j + 1]) for j in range(near[k], near[k + 1])]
    cap = np.array(strip)
    faces += [cap, cap[:, ::-1] + (n - 1) * m]
    mesh = trimesh.Trimesh(corners, np.concatenate(faces), process=False)
    if mesh.volume < 0:
        mesh.invert()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    mesh.export(Path(__file__).with_suffix(".ply"))
    print(f"{len(mesh.faces):,} triangles; the channel ends at {places[-1]} and goes {along[-1]}")


if __name__ == "__main__":
    main()
