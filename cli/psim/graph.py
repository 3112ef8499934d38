"""`psim graph`: what acts on what in a scenario."""

from __future__ import annotations

from typing import Annotated

import typer

from psim.options import Overrides, ScenarioFile


def graph(
    scenario: ScenarioFile,
    overrides: Overrides = None,
    mermaid: Annotated[
        bool, typer.Option("--mermaid", help="As a Mermaid flowchart, which GitHub shows in Markdown.")
    ] = False,
) -> None:
    """Draw the graph of a simulation: its groups, what acts on them, and which step together."""
    import particlesim as ps
    from particlesim.graph.graph import build_graph

    built = build_graph(ps.load(scenario, overrides or ()))
    print(built.as_mermaid() if mermaid else built.as_text())
