"""Runs killed at random moments end, resumed, with the bytes of runs that were left alone."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are forked and killed")


KINDS = ("fountain", "cloth", "memory", "adaptive")
"""Scenarios whose kernels other tests compile as well."""


def torment(*options: str) -> str:
    """What tests/resume/kills.py prints."""
    script = Path(__file__).with_name("kills.py")
    done = subprocess.run(
        [sys.executable, str(script), *options], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()[-1]


def test_ten_kills():
    told = torment("--kills", "10", "--seed", "2", "--kinds", *KINDS)
    kills, moments = (int(words.split()[0]) for words in told.split(", "))
    assert kills == 10
    assert moments >= 4  # frames left by kills: they do not all fall into the start


def test_kills_of_the_command():
    options = ("--kills", "2", "--seed", "5", "--kinds", "memory", "--longer", "5", "--command")
    assert torment(*options).startswith("2 kills")
