import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import screwgauge
from support.command import main
from support.errors import ReportError
from support.report import RENDERER, DrawingError, losses

pytestmark = pytest.mark.slow

ASKED = ["run", "slider-crank", "--engines", "screw", "--quantities", "joint_position"]
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="2" height="2"></svg>'


def short_of_addresses() -> None:
    """As ``ulimit -v 8000000`` does; V8 reserves more."""
    resource.setrlimit(resource.RLIMIT_AS, (8_000_000_000, resource.RLIM_INFINITY))


def short(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-m", "screwgauge.cli", *arguments]
    more = {"capture_output": True, "text": True, "env": environment, "check": False}
    return subprocess.run(command, preexec_fn=short_of_addresses, **more)


@pytest.mark.slow
def test_a_run_that_cannot_draw_has_verdict_results_and_a_report_that_says_what_is_missing(tmp_path):
    done = short(*ASKED, "--json", "--out", str(tmp_path / "out"))
    assert done.returncode == 3
    assert json.loads(done.stdout)["ok"] is True
    assert done.stderr.startswith(f"screwgauge: {tmp_path / 'out'}: ")
    assert re.search("pictures.*SIG.*8 GB .ulimit -v", done.stderr)
    assert done.stderr.count("\n") == 1
    assert json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["ok"] is True
    for name in ("report.md", "report.html"):
        text = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert "Not drawn: " in text
        assert "address space" in text
    assert (tmp_path / "out" / "plots" / "mechanism.svg").is_file()  # which needs no V8


@pytest.mark.slow
def test_a_diagnosis_that_cannot_draw_has_its_verdict(tmp_path):
    folder = Path(screwgauge.models.__file__).parent / "slider-crank"
    text = (folder / "slider-crank.xml").read_text(encoding="utf-8")
    (tmp_path / "b.xml").write_text(re.sub(r'mass="[^"]*"', 'mass="7.5"', text, count=1), encoding="utf-8")
    out = tmp_path / "out"
    done = short("diagnose", str(folder / "slider-crank.xml"), str(tmp_path / "b.xml"), "--out", str(out))
    assert done.returncode == 3
    assert "DIFFER" in done.stdout
    assert done.stdout.endswith(f"report: {out / 'report.html'}\n")
    assert "pictures could not be drawn" in done.stderr
    assert json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["verdict"].count("mass 7.500 kg")


@pytest.mark.slow
def test_a_picture_of_a_mechanism_needs_no_v8(tmp_path):
    done = short("view", "slider-crank", "--png", str(tmp_path / "a.png"))
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_the_verdict_is_printed_and_the_numbers_are_there_before_anything_is_drawn(tmp_path, capfd, monkeypatch):
    seen = []

    def ask(call, *arguments, **named):
        seen.append((capfd.readouterr().out, (tmp_path / "out" / "summary.json").is_file()))
        raise DrawingError("no pencil", "the drawing", "sharpen one")

    monkeypatch.setattr(RENDERER, "ask", ask)
    main([*ASKED, "--out", str(tmp_path / "out")])
    (printed, there), *others = seen
    assert "Only screw ran" in printed
    assert there
    assert {out for out, _ in others} <= {""}
    assert capfd.readouterr().out == f"\nreport: {tmp_path / 'out' / 'report.html'}\n"


@pytest.fixture
def renderer():
    RENDERER.end()
    yield RENDERER
    RENDERER.end()


def test_a_drawing_that_breaks_is_lost_and_the_next_is_drawn(renderer):
    with losses() as lost:
        with pytest.raises(DrawingError, match="JSON"):
            renderer.ask("vegalite_to_svg", "nothing")
        pid = renderer.process.pid
        assert renderer.ask("svg_to_png", SVG, scale=2.0).startswith(b"\x89PNG")
        renderer.process.kill()
        renderer.process.wait()
        assert renderer.ask("svg_to_png", SVG).startswith(b"\x89PNG")  # by a new process
    assert renderer.process.pid != pid
    assert len(lost) == 1


def test_a_process_that_never_answered_is_not_started_again_and_again(renderer, monkeypatch):
    renderer.start()
    renderer.process.kill()
    renderer.process.wait()
    pid = renderer.process.pid
    for _ in range(3):
        with pytest.raises(DrawingError, match="was killed"):
            renderer.ask("svg_to_png", SVG)
    assert renderer.process.pid == pid


@pytest.mark.slow
def test_what_is_lost_of_a_report_is_said_in_it_and_raised(tmp_path, monkeypatch):
    results = screwgauge.run(screwgauge.load_scene("slider-crank"), ["screw"], ["joint_position", "joint_velocity"])
    ask, calls = RENDERER.ask, []

    def once(call, *arguments, **named):
        calls.append(call)
        return ask(call, "broken" if len(calls) == 1 else arguments[0], **named) if arguments else "vega();"

    monkeypatch.setattr(RENDERER, "ask", once)
    with pytest.raises(ReportError, match=r"1 of the report's pictures"):
        results.write(tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert text.count("Not drawn: ") == 1
    assert len([*tmp_path.glob("plots/0*.svg")]) >= 1
