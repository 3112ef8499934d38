"""Order of convergence, and runs done again."""
