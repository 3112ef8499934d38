"""Pictures and videos of trajectories, drawn in software on the CPU."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from particlesim.render.scene.source import BallShape, FrameSource, MeshShape, PlaneShape
from particlesim.scenario.rendering import Camera, RenderSettings

if TYPE_CHECKING:
    from particlesim.render.video import RenderReport, render_frame, render_video

__all__ = [
    "BallShape",
    "Camera",
    "FrameSource",
    "MeshShape",
    "PlaneShape",
    "RenderReport",
    "RenderSettings",
    "render_frame",
    "render_video",
]


def __getattr__(name: str) -> Any:
    """What needs the compiler is imported when it is first asked for."""
    if name in ("RenderReport", "render_frame", "render_video"):
        from particlesim.render import video

        return getattr(video, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
