"""Where a trajectory comes from: everything needed to run it again and to explain it."""

from __future__ import annotations

import datetime
import os
import platform
import shlex
import shutil
import subprocess
import sys
import uuid
from importlib import import_module
from pathlib import Path

from particlesim.scenario.digest import physics_digest
from particlesim.scenario.dump import dump
from particlesim.scenario.extensions import recorded
from particlesim.scenario.scenario import Scenario
from particlesim.version import __version__

PACKAGES = ("numpy", "llvmlite", "h5py", "pydantic")
GIT_TIMEOUT = 2.0


def provenance(scenario: Scenario, particles: int) -> dict[str, str | int | float]:
    """The resolved scenario as TOML, the digest of its physics, a name for this run, overrides, versions, seed, host, git
    revision, command, the most `particles` that are expected at the same time, and the packages whose types it uses."""
    facts: dict[str, str | int | float] = {
        "scenario": dump(scenario, defaults=True),
        "title": scenario.title,
        "overrides": "\n".join(scenario.overrides),
        "physics": physics_digest(scenario),
        "run": uuid.uuid4().hex,
        "psim": __version__,
        "python": platform.python_version(),
        "platform": f"{platform.system()}-{platform.release()}-{platform.machine()}",
        "host": platform.node(),
        "particles": particles,
        "seed": scenario.simulation.seed,
        "dt": scenario.grid.dt,
        "command": shlex.join(sys.argv),
        "started": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "folder": str(scenario.folder or ""),
        "git": git_revision(scenario.folder),
    }
    if used := recorded(scenario):
        facts["extensions"] = used
    # What the packages say themselves: the metadata of their installation takes longer to read than all the rest.
    return facts | {name: str(import_module(name).__version__) for name in PACKAGES}


def git_revision(folder: Path | None) -> str:
    """Revision of the repository that the scenario lies in, '+' if it has changes; empty if there is none."""
    if folder is None or not (_in_repository(folder) or "GIT_DIR" in os.environ):
        return ""
    git = shutil.which("git")
    if git is None:
        return ""
    try:
        done = subprocess.run(
            [git, "describe", "--always", "--dirty=+", "--abbrev=40", "--exclude=*"],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=GIT_TIMEOUT,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _in_repository(folder: Path) -> bool:
    """Whether git may find a repository: it looks for `.git` here and above. To ask git itself takes longer."""
    return any((each / ".git").exists() for each in (folder, *folder.parents))
