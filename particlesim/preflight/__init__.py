"""Before a run: memory, disk, time, and advice."""
