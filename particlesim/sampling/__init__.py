"""Random numbers, distributions, shapes and regions."""
