"""A process that records until it is killed.

Usage: python victim.py FILE PARTICLES COMPRESSION SECONDS_PER_FRAME FRAMES

Prints the number of frames that the writer has acknowledged, one line whenever it grows.
"""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from conftest import open_writer, synthetic_columns, synthetic_ledger

path, particles, compression, pause, frames = sys.argv[1:]
with open_writer(Path(path), compression=compression, particles_hint=64) as writer:
    seen = 0
    for k in range(int(frames)):
        count = (int(particles) * (k % 5)) // 4
        writer.events("birth", [k], k / 10, 0)
        writer.append(k / 10, 5 * k, synthetic_columns(k, count), synthetic_ledger(k))
        time.sleep(float(pause))
        if writer.frames_written > seen:
            seen = writer.frames_written
            print(seen, flush=True)
