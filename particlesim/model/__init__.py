"""The base of all tables of a scenario: units, errors, spelling, vectors."""
