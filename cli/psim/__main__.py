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

    run()


if __name__ == "__main__":
    main()
