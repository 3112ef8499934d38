"""Forces between particles, kind by kind."""
