"""Energy and momentum as sums over particles, and the work of forces."""
