"""Who is near whom: particles in an order that keeps neighbours together, a tree over them, and lists of candidates."""
