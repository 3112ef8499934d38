"""From a scenario to nodes and edges, and to islands."""
