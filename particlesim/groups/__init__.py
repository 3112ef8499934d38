"""Groups of particles, and what is said of them: selections, motions, impulses."""
