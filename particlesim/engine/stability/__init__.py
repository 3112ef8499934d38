"""The longest stable step: eigenvalues of the linearised motion."""
