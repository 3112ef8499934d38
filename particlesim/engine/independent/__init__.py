"""Steps of independent particles, block by block."""
