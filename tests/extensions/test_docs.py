"""The package that docs/extensions.md shows works as it stands."""

from __future__ import annotations

import importlib
import re
import tomllib
from pathlib import Path

from .conftest import write_package

PAGE = (Path(__file__).resolve().parents[2] / "docs/extensions.md").read_text(encoding="utf-8")


def shown(name: str) -> str:
    """A file of the page."""
    found = re.search(rf"<!-- {re.escape(name)} -->\n```\w+\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_package_of_the_page_passes_its_own_tests(site: Path) -> None:
    project = tomllib.loads(shown("pyproject.toml"))["project"]
    entries = "\n".join(
        f"[{group}]\n" + "\n".join(f"{name} = {target}" for name, target in points.items())
        for group, points in project["entry-points"].items()
    )
    source = shown("magnetic_forces.py")
    write_package(site, project["name"], "magnetic_forces", source, entries, project["version"])
    (site / "page_tests.py").write_text(shown("test_magnetic_forces.py"), encoding="utf-8")
    importlib.invalidate_caches()
    tests = importlib.import_module("page_tests")
    tests.test_it_is_a_proper_force()
    tests.test_charges_circle_at_the_cyclotron_frequency()
