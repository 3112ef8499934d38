"""Energy, momentum and work: sums over particles, and what forces have done."""
