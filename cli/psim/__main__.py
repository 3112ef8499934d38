"""The way in, for `psim` and for `python -m psim`.

Nothing is imported here that takes time: Ctrl-C counts from the first moment.
"""

from __future__ import annotations

import os
import signal


def main() -> None:
    """Run the command line and end the process with its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # Until `psim.stop` listens, there is nothing to put in order: end at once, instead of in the middle of an import.
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(130))
    from psim.app import main as run

    run()


if __name__ == "__main__":
    main()
