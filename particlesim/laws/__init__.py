"""Laws: pure functions of a record and a particle."""
