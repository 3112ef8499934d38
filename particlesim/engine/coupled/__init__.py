"""Steps of islands: particles that act on each other take every step together."""
