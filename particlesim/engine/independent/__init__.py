"""Steps of particles that nothing ties to others, block by block."""
