"""The other subcommands, help, completion, and what importing costs."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer
from jsonschema import Draft7Validator
from rich.text import Text

import particlesim as ps
from particlesim.errors import UsageError
from particlesim.scenario.examples import examples_folder
from particlesim.version import __version__
from psim import app, complete
from psim.console import duration, rate
from psim.options import parse_frames

from .conftest import REPOSITORY, TINY, Ended, environment, files, real

COMMANDS = (
    "run",
    "verify",
    "check",
    "render",
    "inspect",
    "diff",
    "rerun",
    "plot",
    "export",
    "migrate",
    "new",
    "examples",
    "describe",
    "graph",
    "schema",
)


def test_help_and_version(psim):
    assert psim("--version").out == f"psim {__version__}\n"
    told = psim("--help")
    assert told.code == 0
    for word in (*COMMANDS, "Simulate", "Look", "Learn"):
        assert word in told.out
    for command in COMMANDS:
        told = psim(command, "--help")
        assert told.code == 0
        assert f"psim {command} " in told.out.split("Examples")[1]


def test_no_command_shows_help(psim):
    ended = psim()
    assert "Usage" in ended.out + ended.err


def test_help_imports_nothing_heavy():
    code = "import sys; sys.argv = ['psim', '--help']\ntry:\n import psim.app as a; a.main()\nexcept SystemExit: pass\n"
    code += "print(sorted({m.split('.')[0] for m in sys.modules} | {'rich.progress'} & set(sys.modules)), file=sys.stderr)"
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment(), check=True
    )
    for heavy in (
        "pydantic",
        "numpy",
        "llvmlite",
        "h5py",
        "scipy",
        "pint",
        "matplotlib",
        "rich.progress",
        "imageio",
    ):
        assert f"'{heavy}'" not in ended.stderr


def test_a_simple_run_imports_nothing_needless():
    code = "import sys; import particlesim as ps; ps.run(ps.load('tiny.toml'), 'a.vtkhdf')\n"
    code += "print(' '.join(sys.modules))"
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment(), check=True
    )
    for heavy in (
        "scipy.linalg",
        "scipy.special",
        "pint",
        "matplotlib",
        "imageio_ffmpeg",
        "PIL",
        "rich",
        "typer",
    ):
        assert heavy not in ended.stdout.split()


def test_check(psim):
    ended = psim("check", "tiny.toml")
    assert ended.code == 0
    for words in (
        "tiny.toml · Tiny",
        "balls",
        "gravity",
        "at most 3",
        "10 of 0.01 s",
        "symplectic_euler",
        "MB",
        "kB",
    ):
        assert words in ended.out
    assert not ended.err
    (told,) = psim("check", "tiny.toml", "--json").json
    assert (told["particles"], told["steps"], told["frames"]) == (3, 10, 3)
    assert set(files()) == {"tiny.toml"}


def test_check_warns_of_output_that_exists(psim):
    psim("run", "tiny.toml", "-q")
    ended = psim("check", "tiny.toml")
    assert ended.code == 0
    assert "outputs/tiny.vtkhdf exists" in ended.err


def test_inspect(psim, recorded):
    told = psim("inspect", recorded)
    for words in (
        "Tiny",
        "complete",
        "3, 0 to 0.1 s",
        "velocity",
        "m/s",
        "potential.gravity",
        "J",
        "balls (3)",
    ):
        assert words in told.out
    assert psim("inspect", recorded, "--json").json["frames"] == 3
    Path("again.toml").write_text(psim("inspect", recorded, "--scenario").out)
    assert ps.load("again.toml").title == "Tiny"


def test_plot(psim, recorded):
    assert psim("plot", recorded, "energy").out == "recorded-energy.png\n"
    assert Path("recorded-energy.png").read_bytes()[1:4] == b"PNG"
    assert psim("plot", recorded, "y", "--ids", "0,2", "--group", "balls", "-o", "y.svg").out == "y.svg\n"
    assert psim("plot", recorded, "energy").code == 2  # exists
    assert psim("plot", recorded, "energy", "--force", "-q").out == ""


def test_export(psim, recorded):
    ended = psim("export", recorded, "-o", "last.csv", "--frames=-1:", "--fields", "velocity")
    assert ended.out == "last.csv\n"
    assert "3 rows" in ended.err
    with Path("last.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["time"]) for row in rows] == [0.1] * 3
    assert float(rows[0]["vy"]) == pytest.approx(-9.80665 * 0.1, rel=1e-6)
    assert psim("export", recorded, "-o", "all.npz").code == 0


def test_render(psim, recorded):
    ended = psim(
        "render",
        recorded,
        "-o",
        "still.png",
        "--frames",
        "1",
        "--look",
        "dots",
        "--color-by",
        "y",
        "--size",
        "80x60",
    )
    assert ended.out == "still.png\n"
    assert "1 picture in" in ended.err
    arguments = (
        "--camera-eye",
        "1,2,3",
        "--camera-target",
        "0,1,0",
        "--set",
        "render.camera.fov=50",
        "--fps",
        "10",
    )
    assert psim("render", recorded, "-q", *arguments).out == ""
    assert Path("recorded.mp4").stat().st_size > 100


def test_graph(psim):
    told = psim("graph", "tiny.toml").out
    assert "particles balls: 3 particles" in told
    assert "<- force gravity: f = m g" in told
    assert psim("graph", "tiny.toml", "--mermaid").out.startswith("flowchart LR\n")


@pytest.mark.parametrize("template", ["throw", "emitter", "springs"])
def test_new(psim, template):
    ended = psim("new", "my_scene", "--template", template)
    assert ended.out == "my_scene.toml\n"
    text = Path("my_scene.toml").read_text()
    Draft7Validator(psim("schema").json).validate(tomllib.loads(text))
    assert ps.load("my_scene.toml").title == "My scene"
    assert psim("check", "my_scene.toml").code == 0


def test_examples(psim):
    told = psim("examples").out
    names = {path.stem for path in examples_folder().glob("*.toml")}
    assert names
    assert names == {line.split()[0] for line in told.splitlines()}
    assert psim("examples", "fountain").out == (examples_folder() / "fountain.toml").read_text()
    assert psim("examples", "fountain", "--copy", "here").out == "here/fountain.toml\n"
    assert psim("check", "here/fountain.toml").code == 0
    assert psim("examples", "fountain", "--copy", "here").code == 2
    assert psim("examples", "fountain", "--copy", "here", "--force").code == 0


def test_examples_are_copied_with_the_files_that_they_name(psim, tmp_path):
    for name in ("dice", "rain_on_hills"):
        assert psim("examples", name, "--copy", "here").code == 0
        assert psim("check", f"here/{name}.toml", "--no-stability").code == 0
    (tmp_path / "here" / "octahedron.obj").unlink()
    assert "octahedron.obj does not exist" in psim("check", "here/dice.toml", "--no-stability").err
    (tmp_path / "here" / "octahedron.obj").write_text("mine")
    assert psim("examples", "dice", "--copy", "here").code == 2
    (tmp_path / "here" / "dice.toml").unlink()
    assert psim("examples", "dice", "--copy", "here").code == 2, "a file of somebody else's"


def test_examples_of_an_installed_package(tmp_path, monkeypatch):
    """In a wheel the scenarios lie inside of the package."""
    import particlesim.scenario.examples as module

    package = tmp_path / "site-packages" / "particlesim"
    (package / "examples").mkdir(parents=True)
    monkeypatch.setattr(module, "__file__", str(package / "scenario" / "examples.py"))
    assert module.examples_folder() == package / "examples"
    (package / "examples").rmdir()
    with pytest.raises(UsageError, match="missing"):
        module.examples_folder()


def test_describe(psim):
    told = psim("describe").out
    for word in ("gravity", "vortex", "lattice", "rk4", "emitters", "planes"):
        assert word in told
    told = psim("describe", "linear_drag").out
    assert "f = −k (v − w)" in told
    assert "in kg/s; required" in told
    assert "4 force evaluations" in psim("describe", "rk4").out
    for name in complete_names():
        assert psim("describe", name).code == 0
    assert psim("describe", "plane").out == psim("describe", "planes").out
    told = psim("describe", "restitution").out
    assert "Speed after over speed before the impact" in told
    assert "in [[planes]]" in told
    assert "field of view" in psim("describe", "camera").out
    assert "sheet_drag" in psim("describe", "forces").out
    assert "A solid sphere" in psim("describe", "ball").out


def test_describe_knows_words_of_other_tools(psim):
    told = psim("describe", "roughness")
    assert told.code == 2
    assert '"friction" of [[planes]]' in told.err
    assert '"velocity_verlet" or "stormer_verlet"' in psim("describe", "leapfrog").err


def complete_names() -> list[str]:
    from psim.describe import _names

    return _names()


def test_schema_beside_the_scenarios_is_fresh(psim):
    committed = json.loads((REPOSITORY / "scenarios" / "psim.schema.json").read_text())
    # Some versions of pydantic write 0.0 for 0.
    assert psim("schema").json == committed, "psim schema -o scenarios/psim.schema.json --force"
    assert psim("schema", "-o", "a.json").out == "a.json\n"
    assert json.loads(Path("a.json").read_text()) == committed


@pytest.mark.parametrize("path", sorted((REPOSITORY / "scenarios").glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_scenarios_name_their_schema_and_fit_it(path):
    text = path.read_text()
    assert text.startswith("#:schema ./psim.schema.json\n")
    schema = json.loads((path.parent / "psim.schema.json").read_text())
    Draft7Validator(schema).validate(tomllib.loads(text))


def test_completion(tmp_path):
    Path("runs").mkdir()
    shutil.copy("tiny.toml", "runs/other.toml")
    Path("notes.txt").touch()
    assert complete.scenario_files("") == ["runs/", "tiny.toml"]
    assert complete.scenario_files("runs/o") == ["runs/other.toml"]
    assert complete.scenario_files("gone/x") == []
    assert complete.trajectory_files("t") == []
    assert "fountain" in complete.example_names("fou")
    line = "psim run tiny.toml --set particles."
    ended = real(
        env={**environment(), "_PSIM_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": "4"}
    )
    assert "particles.balls.mass=" in ended.out.split()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, None),
        ("3", slice(3, 4)),
        ("-1", slice(-1, None)),
        ("2:5", slice(2, 5)),
        ("::2", slice(None, None, 2)),
    ],
)
def test_frames(text, expected):
    assert parse_frames(text) == expected


@pytest.mark.parametrize("text", ["", "a:b", "1:2:0", "1:2:3:4", "1.5"])
def test_frames_that_are_none(text):
    with pytest.raises(UsageError):
        parse_frames(text)


def test_units_of_talk():
    assert [duration(t) for t in (0.5, 12.34, 200, 7500)] == ["0.50 s", "12.3 s", "3 min 20 s", "2 h 05 min"]
    assert rate(3.21e8) == "321 M particle-steps/s"
    assert rate(12) == "12 particle-steps/s"


SPRUNG = """\
format = 1
[simulation]
duration = 0.1
dt = 0.05
[[particles]]
name = "pair"
layout = { type = "points", position = [[0, 0, 0], [1.1, 0, 0]] }
[[springs]]
on = "pair"
pairs = [[0, 1]]
stiffness = 800.0
rest_length = 1.0
"""
"""ω² = 2k/m = 1600/s²: symplectic Euler is stable up to 2/40 s."""


def test_stability(psim):
    Path("pair.toml").write_text(SPRUNG)
    ended = psim("stability", "pair.toml")
    assert ended.code == 0
    assert "0.05 s with symplectic_euler" in ended.out
    assert not ended.err
    beyond = ("--set", "simulation.dt=0.1")
    told = psim("stability", "pair.toml", "--json", "--plot", "region.png", *beyond).json
    assert told["largest_stable_dt"] == pytest.approx(0.05, rel=1e-6)
    assert told["islands"][0]["forces"] == {"springs": pytest.approx(0.05, rel=1e-6)}
    assert "simulation.dt = 0.045" in told["warnings"][0]
    assert Path("region.png").read_bytes().startswith(b"\x89PNG")
    assert psim("stability", "pair.toml", "--plot", "region.png").code == 2
    assert psim("stability", "pair.toml", "--plot", "region.xyz").code == 2


def test_check_and_run_tell_of_steps_that_are_too_long(psim):
    Path("pair.toml").write_text(SPRUNG)
    beyond = ("--set", "simulation.dt=0.1")
    checked = psim("check", "pair.toml", *beyond)
    assert "stable dt" in checked.out
    assert "beyond the largest stable step" in checked.err
    assert psim("check", "pair.toml", "--json").json[0]["stability"]["largest_stable_dt"] == pytest.approx(
        0.05
    )
    # Two steps, and a force of which nobody knows what it feeds: a conservative run would end for its energy.
    Path("pair.toml").write_text(SPRUNG + '[[forces]]\ntype = "field"\nforce = ["0*t", "0", "0"]\n')
    beyond = (*beyond, "--set", "simulation.duration=0.2", "--set", "output.ledger=false")
    ended = psim("run", "pair.toml", *beyond)
    assert ended.err.count("beyond the largest stable step") == 1
    assert "beyond" in psim("run", "pair.toml", "--json", "--force", *beyond).json["warnings"][0]


def test_warnings_have_a_place_in_the_file(psim):
    """As errors have: of the step, of a group, of a collider; in JSON beside the sentences, which stay as they are."""
    sunk = SPRUNG.replace("dt = 0.05", "dt = 0.1") + '[[planes]]\nname = "floor"\npoint = [0, 1, 0]\n'
    Path("pair.toml").write_text(sunk)
    lines = sunk.split("\n")
    step, group = (lines.index(each) + 1 for each in ("dt = 0.1", "[[particles]]"))
    for command in ("check", "run", "stability"):
        told = psim(command, "pair.toml").err
        assert f"\n  --> pair.toml:{step}:6  (simulation.dt)\n" in told
        assert (f"\n  --> pair.toml:{group}:1  (particles.pair)\n" in told) is (command != "stability")
    data = psim("check", "pair.toml", "--json").json[0]
    places = dict(zip(data["advice"], data["advice_places"], strict=True))
    assert {"path": "simulation.dt", "file": "pair.toml", "line": step, "column": 6} in places.values()
    data = psim("stability", "pair.toml", "--json").json
    assert [each["line"] for each in data["warning_places"]] == [step]
    data = psim(
        "run", "pair.toml", "--json", "--force", "--set", "simulation.dt=0.01", "--set", "output.ledger=false"
    ).json
    assert len(data["warnings"]) == len(data["warning_places"]) > 0


def test_check_quietly(psim):
    assert psim("check", "tiny.toml", "--quiet") == Ended(0, "", "")
    Path("bad.toml").write_text("nonsense")
    ended = psim("check", "-q", "tiny.toml", "bad.toml")
    assert (ended.code, ended.out) == (2, "")
    assert "bad.toml:1" in ended.err


def test_many_names_are_cut_short(psim):
    forces = "".join('\n[[forces]]\ntype = "gravity"\nacceleration = [0, 0, 0]\n' for _ in range(40))
    Path("many.toml").write_text(TINY + forces)
    ended = psim("check", "many.toml")
    assert "gravity_12 and 29 more" in ended.out
    assert "gravity_13" not in ended.out
    assert len(psim("check", "many.toml", "--json").json[0]["forces"]) == 41


def test_a_path_with_spaces_is_quoted_where_it_is_to_be_copied(psim):
    assert "psim run 'my scene.toml' --video" in psim("new", "my scene").err


def test_sizes_in_words():
    from particlesim.preflight.resources import size

    words = [size(b) for b in (0, 999, 1000, 2.5e6, 1e15, 2e18, 4e24)]
    assert words == ["0 B", "999 B", "1.0 kB", "2.5 MB", "1.0 PB", "2.0 EB", "4e+06 EB"]


def test_no_help_loses_what_is_in_brackets():
    """Rich takes [m] for a style, and shows nothing."""
    for command in typer.main.get_command(app.app).commands.values():
        for parameter in command.params:
            text = getattr(parameter, "help", None) or ""
            shown = Text.from_markup(text).plain
            assert text.replace("\\[", "[") == shown, (command.name, parameter.name)
