"""Imports and numbers of a request."""

import subprocess
import sys
from functools import cache

import pytest

import screwgauge
from support.command import CLI, printed_by
from support.engines import Solution

pytestmark = pytest.mark.slow


def modules_after(code: str) -> set[str]:
    """Return modules that code loads."""
    script = f"{code}\nimport sys\nprint('\\n' + ' '.join(sorted(sys.modules)))"
    return set(printed_by(script).splitlines()[-1].split())


@pytest.mark.slow
def test_screw_alone_imports_no_engine():
    code = (
        "import screwgauge\n"
        "scene = screwgauge.load_scene('3ups-upu-s').at([0.0, 1.0])\n"
        "assert screwgauge.run(scene, engines=['screw']).ok"
    )
    assert not modules_after(code) & {"pinocchio", "mujoco", "yourdfpy", "vl_convert"}


@pytest.mark.slow
def test_screw_alone_on_the_command_line_imports_no_engine(paper_scene, tmp_path):
    arguments = ["run", str(paper_scene()), "--engines", "screw", "--quantities", "joint_position"]
    code = f"import screwgauge.cli\nassert screwgauge.cli.main({[*arguments, '--out', str(tmp_path / 'out')]}) == 0"
    assert not modules_after(code) & {"pinocchio", "mujoco", "yourdfpy"}


def test_help_imports_not_even_numpy():
    code = "import screwgauge.cli\ntry:\n    screwgauge.cli.main(['--help'])\nexcept SystemExit: pass"
    assert not modules_after(code) & {"numpy", "pandas", "vl_convert", "pinocchio", "mujoco"}


@cache
def solved(engine: str, *quantities: str) -> Solution:
    scene = screwgauge.load_scene("3ups-upu-s-fast").at([0.0, 0.1])
    return screwgauge.run(scene, engines=[engine], quantities=quantities or None).solutions[engine]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["screw", "pinocchio", "mujoco"])
@pytest.mark.parametrize("quantity", ["joint_position", "joint_velocity", "com_acceleration", "generalized_force"])
def test_only_what_was_asked_for_is_returned_and_unchanged(engine, quantity):
    alone, everything = solved(engine, quantity), solved(engine)
    assert set(alone.values) == {quantity}
    assert (alone.values[quantity].array == everything.values[quantity].array).all()
    assert len(alone.timings) < len(everything.timings)


@pytest.mark.slow
def test_a_reader_who_leaves_changes_no_exit_status(tmp_path, write):
    # as `| head` does
    scene = write(
        "strict.toml",
        'mechanism = "3ups-upu-s"\nengines = ["screw", "mujoco"]\nquantities = ["joint_position"]\n'
        "[motion.a]\noffset = 0.1\n[motion.b]\noffset = 0.1\n"
        "[time]\ntimes = [0]\n[tolerances]\njoint_position = 1e-30\n",
    )
    command = [sys.executable, "-c", CLI, "run", str(scene), "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        complaint = process.stderr.read()
    beyond_progress = [line for line in complaint.decode().splitlines() if "% done after" not in line]
    assert (process.returncode, beyond_progress) == (1, [])
