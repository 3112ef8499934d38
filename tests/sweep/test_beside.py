"""Processes beside this one."""

from __future__ import annotations

import subprocess
import sys

import pytest

ENDED_WHILE_COPIED = """
import os, signal
from particlesim.process.beside import Beside

def work(connection):
    connection.recv()

def stop(*_):
    raise KeyboardInterrupt

signal.signal(signal.SIGTERM, stop)
os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGTERM))
try:
    beside = Beside(work, [])
except KeyboardInterrupt:
    print("the copy goes on with the work of the first")
else:
    beside._process.join()
    print(beside._process.exitcode)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux only")
def test_a_process_that_is_ended_while_it_is_copied_does_nothing_else() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", ENDED_WHILE_COPIED], capture_output=True, text=True, check=True, timeout=20
    )
    assert ended.stdout.split() == ["-15"]
