"""What a command needs not, it does not import and does not compile: a small run starts like a script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import environment

LED = """
format = 1
[simulation]
duration = 0.1
dt = 0.01
[[particles]]
name = "rope"
layout = { type = "rope", start = [0, 0, 0], end = [1, 0, 0], count = 5, pinned = "both" }
springs = { structural = 100.0 }
[[motions]]
on = "rope"
path = ["x + sin(t)", "y", "z"]
"""
FREE = """
format = 1
[simulation]
duration = 0.1
dt = 0.01
[[particles]]
layout = { type = "points", position = [[0, 0, 0]] }
[[forces]]
type = "gravity"
"""


def run(code: str, folder: Path) -> str:
    ended = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**environment(), "PSIM_CACHE_DIR": str(folder / "cache")},
        cwd=folder,
        check=True,
    )
    return ended.stdout


def test_a_warm_run_without_output_imports_what_it_uses(tmp_path: Path) -> None:
    (tmp_path / "free.toml").write_text(FREE)
    code = "import sys\nimport particlesim as ps\nps.run('free.toml', threads=2)\nprint(*sorted(sys.modules))"
    run(code, tmp_path)
    imported = set(run(code, tmp_path).split())
    not_used = {
        "particlesim.compiler.walker",
        "particlesim.compiler.elementary",
        "particlesim.scenario.text.diagnose",
        "concurrent.futures",
        "h5py",
        "scipy",
        "pint",
        "rich",
        "typer",
        "difflib",
    }
    assert "particlesim.compiler.machine" in imported
    assert imported & not_used == set()


@pytest.mark.parametrize("scene", [LED, FREE], ids=["led", "free"])
def test_check_compiles_nothing(scene: str, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(scene)
    code = "import sys; sys.argv = ['psim', 'check', 'scene.toml']\n"
    code += "try:\n import psim.app as a; a.main()\nexcept SystemExit: pass\n"
    code += "print('walker:', 'particlesim.compiler.walker' in sys.modules)"
    told = run(code, tmp_path)
    assert "walker: False" in told
    assert "stable dt" in told


def test_a_check_of_many_that_interact_needs_kernels_that_are_kept(tmp_path: Path) -> None:
    places = [[float(k), 0.0, 0.0] for k in range(400)]
    scene = (
        FREE.replace("[[0, 0, 0]] }", f"{places} }}\ncharge = 1e-9") + '[[interactions]]\ntype = "coulomb"\n'
    )
    (tmp_path / "scene.toml").write_text(scene)
    code = "import sys; sys.argv = ['psim', 'check', 'scene.toml']\n"
    code += "try:\n import psim.app as a; a.main()\nexcept SystemExit: pass\n"
    code += "print('walker:', 'particlesim.compiler.walker' in sys.modules)"
    told = run(code, tmp_path)
    assert "walker: False" in told
    assert "not computed" in told


def test_a_check_tells_what_is_outside_of_the_box_in_any_case(tmp_path: Path) -> None:
    places = [[float(k), 0.5, 0.5] for k in range(400)]
    scene = FREE.replace("[[0, 0, 0]] }", f"{places} }}\nmass = 1e-9").split("[[forces]]")[0]
    scene = scene.replace("dt = 0.01", "dt = 0.01\nbox = { size = [300.5, 1, 1] }")
    (tmp_path / "scene.toml").write_text(scene + '[[interactions]]\ntype = "gravity"\n')
    code = "import sys; sys.argv = ['psim', 'check', 'scene.toml']; sys.stderr = sys.stdout\n"
    code += "try:\n import psim.app as a; a.main()\nexcept SystemExit: pass\n"
    told = run(code, tmp_path)
    assert "not computed" in told
    assert "99 of 400 particles of 'particles' start outside of the periodic box" in told


def test_a_check_of_starts_that_overlap_in_a_box_compiles_nothing(tmp_path: Path) -> None:
    places = [[k / 400, 0.5, 0.5] for k in range(400)]
    scene = FREE.replace("[[0, 0, 0]] }", f"{places} }}\nmass = 1\nradius = 0.01").split("[[forces]]")[0]
    scene = scene.replace("dt = 0.01", "dt = 0.01\nbox = { size = [1, 1, 1] }")
    law = '[[interactions]]\ntype = "contact"\nmodel = "linear"\nstiffness = 10\n'
    (tmp_path / "scene.toml").write_text(scene + law)
    code = "import sys; sys.argv = ['psim', 'check', 'scene.toml']\n"
    code += "try:\n import psim.app as a; a.main()\nexcept SystemExit: pass\n"
    code += "print('walker:', 'particlesim.compiler.walker' in sys.modules)"
    told = run(code, tmp_path)
    assert "walker: False" in told
    assert "not computed" in told


def test_a_check_without_the_stable_step_places_nothing(tmp_path: Path) -> None:
    (tmp_path / "free.toml").write_text(FREE)
    code = """
import sys
from psim.app import main
sys.argv = ["psim", "check", "free.toml", "--no-stability"]
try:
    main()
finally:
    print(*sorted(sys.modules))
"""
    told, imported = run(code, tmp_path).rsplit("\n", 2)[:2]
    assert "particles  at most 1 at once" in told
    assert "stable dt" not in told
    assert not {"particlesim.engine.world", "particlesim.engine.simulation"} & set(imported.split())


def test_what_is_imported_is_old_for_the_garbage_collector(tmp_path: Path) -> None:
    code = """
import gc
class Node: pass
node = Node()
node.self = node
import weakref
gone = weakref.ref(node)
import particlesim as ps
ps.load
print(gc.isenabled(), gc.get_freeze_count(), len(gc.get_objects(0)) + len(gc.get_objects(1)) < 5000)
del node
gc.collect()
print(gone())
"""
    assert run(code, tmp_path).splitlines() == ["True 0 True", "None"]
