"""Rules between the tables of a scenario."""
