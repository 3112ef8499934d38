"""What all tables of a scenario share: units, mistakes, spelling, vectors."""
