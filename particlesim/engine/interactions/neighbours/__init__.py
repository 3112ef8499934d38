"""The search for neighbours: particles in an order that keeps neighbours together, a tree over them, and lists."""
