"""What the documentation shows must work: the reference is current, examples validate and run, links lead somewhere."""

from __future__ import annotations

import importlib.util
import linecache
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import particlesim as ps
from particlesim.laws.registry import Particle, force, force_dx, potential

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
FENCE = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

# What a fragment leaves out, so that it can be validated: only sections that are not in it are added.
SIMULATION = "\n[simulation]\nduration = 1.0\ndt = 0.01\n"
PARTICLES = (
    '\n[[particles]]\nname = "ball"\nlayout = { type = "points", position = [[0, 1, 0]] }\nradius = 0.1\n'
)


class Block(NamedTuple):
    """A fenced block of a page: the words after the fence, the text, and where it is."""

    info: str
    text: str
    place: str


def blocks(page: Path) -> Iterator[Block]:
    text = page.read_text(encoding="utf-8")
    for found in FENCE.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        yield Block(found[1].strip(), found[2], f"{page.relative_to(ROOT)}:{line}")


def all_blocks(info: str) -> list[Block]:
    return [block for page in PAGES for block in blocks(page) if block.info == info]


def named(block: Block) -> str | None:
    """The file name in the first line of a scenario, '# sparks.toml'."""
    found = re.match(r"# (\w+\.toml)\n", block.text)
    return found[1] if found else None


def complete(text: str) -> str:
    """A fragment of a scenario with what it needs to stand alone."""
    keys = tomllib.loads(text)
    if "simulation" not in keys:
        text += SIMULATION
    if not {"particles", "bodies", "emitters"} & set(keys):
        text += PARTICLES
    return text


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives to the headings of a page."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def check_reference(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, folder / "generate_reference.py", "--check"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": f"{ROOT}"},
    )


def test_the_reference_is_current() -> None:
    done = check_reference(ROOT / "docs")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_a_stale_reference_is_noticed(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    page = tmp_path / "docs/scenario.md"
    page.write_text(page.read_text(encoding="utf-8").replace("restitution", "bounciness"), encoding="utf-8")
    assert check_reference(tmp_path / "docs").returncode == 1


def test_there_is_something_to_test() -> None:
    assert len(all_blocks("toml")) >= 10
    assert len(all_blocks("python run")) >= 3


@pytest.mark.parametrize("block", all_blocks("toml"), ids=lambda block: block.place)
def test_scenarios_validate(block: Block) -> None:
    scenario = ps.loads(complete(block.text))
    if named(block) is None:
        return
    assert scenario.title, "a complete scenario has a title"
    assert complete(block.text) == block.text, "a named scenario is complete"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page run in order, in a folder that holds its named scenarios."""
    monkeypatch.chdir(tmp_path)
    for block in blocks(page):
        if block.info == "toml" and (name := named(block)) is not None:
            (tmp_path / name).write_text(block.text, encoding="utf-8")
    names: dict[str, object] = {}
    for block in blocks(page):
        if block.info == "python run":
            lines = block.text.splitlines(keepends=True)
            linecache.cache[block.place] = (len(block.text), None, lines, block.place)  # for kernels
            exec(compile(block.text, block.place, "exec"), names)


def test_the_example_of_a_force_is_right(tmp_path: Path) -> None:
    """The file that architecture.md shows: F = −∇U and ∂F/∂x, by central differences of h = 10⁻⁵ (error h² ≈ 10⁻¹⁰)."""
    shown = next(b for b in blocks(ROOT / "docs/architecture.md") if "class AxisPull" in b.text)
    path = tmp_path / "axis_pull.py"
    path.write_text(shown.text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("axis_pull", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["axis_pull"] = module
    try:
        spec.loader.exec_module(module)
        record = module.AxisPull(pull="2 N").record()
    finally:
        del sys.modules["axis_pull"]
    p, h = Particle(0.3, -0.2, 0.7, 1.0, 2.0, 3.0, 1.5, 0.1, 293.0, 0.0), 1e-5
    f, jacobian = force(record, p), force_dx(record, p)
    for column, axis in enumerate("xyz"):
        ahead, behind = (p._replace(**{axis: getattr(p, axis) + step}) for step in (h, -h))
        slope = (potential(record, ahead) - potential(record, behind)) / (2 * h)
        assert f[column] == pytest.approx(-slope, abs=1e-8)
        change = [(a - b) / (2 * h) for a, b in zip(force(record, ahead), force(record, behind), strict=True)]
        assert jacobian[column::3] == pytest.approx(change, abs=1e-8)
    assert force(record, p._replace(x=0.0, z=0.0)) == (0, 0, 0)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http://", "https://", "mailto:")):
            continue
        name, _, anchor = target.partition("#")
        other = page.parent / name if name else page
        assert other.exists(), f"{page.name} links to {target}, which does not exist"
        if anchor:
            assert anchor in anchors(other), f"{page.name} links to {target}, which has no such heading"


def commands() -> list[str]:
    """Every call of psim in shell blocks and in inline code."""
    found = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        shell = "\n".join(block.text for block in blocks(page) if block.info == "bash")
        found += re.findall(r"(?:^|&& |do\s+)(psim .*?)(?= #| \|\| |$)", shell, re.MULTILINE)
        found += re.findall(r"`(psim [^`]+)`", FENCE.sub("", text))
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("line", commands())
def test_commands_exist(line: str) -> None:
    """The subcommand and every option of a command that the documentation shows."""
    app = pytest.importorskip("psim.app").app
    from typer.main import get_command

    command = get_command(app)
    words = shlex.split(line.split(" > ")[0])[1:]
    known = command.commands  # type: ignore[attr-defined]
    if words and not words[0].startswith("-"):
        assert words[0] in known, f"there is no psim {words[0]}"
        command, words = known[words[0]], words[1:]
    options = {
        o
        for parameter in command.params
        for o in (*parameter.opts, *parameter.secondary_opts, "--help", "-h")
    }
    for word in words:
        if re.match(r"-{1,2}[a-zA-Z]", word):
            assert word.partition("=")[0] in options, f"{line}: no option {word}"


@pytest.mark.parametrize(
    "broken", ['[[forces]]\ntype = "gravty"\n', "[simulation]\nduration = 1.0\ndt = 0.3\n"]
)
def test_a_broken_example_would_be_noticed(broken: str) -> None:
    with pytest.raises(ps.ScenarioError):
        ps.loads(complete(broken))
