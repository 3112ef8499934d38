"""Which recorded frame each frame of the video shows."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from particlesim.errors import UsageError
from particlesim.scenario.rendering import RenderSettings

MOST_FRAMES = 1_000_000


def video_speed(span: float, recorded: int, settings: RenderSettings) -> float:
    """Simulated seconds per second of video, for `recorded` frames that cover `span` [s].

    As the settings say; else 1 when the recording is about as dense as the video (between half and four video frames
    per recorded frame), else such that each recorded frame is shown once.
    """
    if settings.speed is not None:
        return settings.speed
    if recorded < 2 or span <= 0:
        return 1.0
    ratio = span / (recorded - 1) * settings.fps
    return 1.0 if ratio * (1 + 1e-9) >= 0.5 and ratio <= 4 else ratio


def video_step(span: float, recorded: int, settings: RenderSettings) -> float:
    """Simulated time [s] from one frame of a video to the next, for that many recorded frames that cover `span` [s].

    Raises UsageError when the video would have an absurd number of frames.
    """
    step = video_speed(span, recorded, settings) / settings.fps
    if span / step > MOST_FRAMES:
        raise UsageError(
            f"the video would have {span / step:.3g} frames",
            f"{span:g} simulated seconds at speed {step * settings.fps:g}: raise `speed` (simulated seconds per second "
            "of video).",
        )
    return step


def timeline(times: npt.NDArray[np.floating], settings: RenderSettings) -> npt.NDArray[np.intp]:
    """Video frame k shows the simulated time times[0] + k speed / fps: the recorded frame nearest to it.

    Raises UsageError when that makes an absurd number of frames.
    """
    times = np.asarray(times, float)
    span = float(times[-1] - times[0])
    step = video_step(span, len(times), settings)
    moments = times[0] + step * np.arange(int(span / step + 1e-6) + 1)
    after = np.clip(np.searchsorted(times, moments), 1, max(len(times) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    # A tie within rounding goes to the earlier frame.
    closer = (times[after] - moments) < (moments - times[before]) - 1e-9 * step
    return np.where(closer, after, before)
