"""The largest stable step: eigenvalues of the linearised motion."""
