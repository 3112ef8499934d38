"""The way in, for `psim` and for `python -m psim`.

Nothing is imported here that takes time: Ctrl-C, SIGTERM and SIGHUP count from the first moment.
"""

from __future__ import annotations

import os

from psim.signals import end_at_once


def main() -> None:
    """Run the command line and end the process with its exit code."""
    end_at_once()
    # psim has no plug-ins for pydantic, which reads the metadata of all installed packages to look for some.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    from psim.app import main as run

    try:
        run()
    except SystemExit as end:
        _leave(end)


def _leave(end: SystemExit) -> None:
    """End the process as Python does, but for taking apart a hundred thousand objects one by one, which takes a tenth of the
    time of a small run. Output has been written by then."""
    import atexit
    import threading

    if threading.active_count() > 1 or not isinstance(end.code, int):
        raise end
    atexit._run_exitfuncs()
    os._exit(end.code)


if __name__ == "__main__":
    main()
