"""Types of forces and flows that other installed packages add: `docs/extensions.md`."""
