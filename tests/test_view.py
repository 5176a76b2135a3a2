import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from screwgauge.commands.view import _serve
from screwgauge.report import console
from support import robots
from support.browser import Opened, open_page
from support.command import main
from support.data import data
from support.mechanism import load_mechanism, suspicious
from support.models import write_models

pytestmark = pytest.mark.slow

BLANK = 6000  # a picture without anything in it is smaller [bytes]


def test_the_page_is_written(tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    assert main(["view", "a01-pendulum", "--out", str(file)]) == 0
    text = file.read_text(encoding="utf-8")
    assert "screwgaugeStage" in text
    assert "freedoms of bob: one rotation about z" in text


@pytest.mark.slow
def test_a_picture_is_written_of_one_or_two_mechanisms(tmp_path: Path) -> None:
    one, two = tmp_path / "one.png", tmp_path / "two.png"
    assert main(["view", "3ups-upu-s", "--png", str(one)]) == 0
    assert main(["view", "3ups-upu-s", "3ups-upu-s-offset", "--png", str(two)]) == 0
    assert one.read_bytes()[:4] == two.read_bytes()[:4] == b"\x89PNG"
    assert one.read_bytes() != two.read_bytes()
    for form, start in (("svg", b"<svg "), ("pdf", b"%PDF")):
        assert main(["view", "3ups-upu-s", f"--{form}", str(file := tmp_path / f"one.{form}")]) == 0
        assert file.read_bytes().startswith(start)


@pytest.mark.slow
def test_what_a_picture_marks_as_suspicious_is_said(tmp_path: Path, capsys) -> None:
    said = {}
    for name in ("screw-press", "slider-crank"):
        assert main(["view", name, "--svg", str(tmp_path / f"{name}.svg")]) == 0
        said[name] = capsys.readouterr().err
    (odd,) = suspicious(load_mechanism("screw-press"))
    assert odd.sentence in said["screw-press"]
    assert said["slider-crank"] == ""


@pytest.mark.slow
def test_a_model_file_is_shown(tmp_path: Path) -> None:
    urdf, mjcf = robots.write(tmp_path)
    for file in (urdf, mjcf):
        page = tmp_path / f"{file.suffix[1:]}.html"
        assert main(["view", str(file), "--out", str(page)]) == 0
        assert "screwgaugeStage" in page.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five-bar", "a03-andrews", "screw-press", "3ups-upu-s"])
@pytest.mark.parametrize("kind", ["urdf", "xml"])
def test_nothing_is_elsewhere_in_a_model_of_the_same_machine(name: str, kind: str, tmp_path: Path) -> None:
    write_models(load_mechanism(name), tmp_path)
    page = tmp_path / "page.html"
    assert main(["view", name, str(tmp_path / f"{name}.{kind}"), "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert '"g":"links"' in text
    assert '"g":"other"' not in text


def test_without_a_motion_the_home_pose_is_shown_and_why_is_said(tmp_path: Path, write, command) -> None:
    file = write("stuck.toml", data("stuck.toml"))
    page = tmp_path / "page.html"
    assert "showing the home pose, " in command("view", file, "--out", page).err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["3ups-upu"], "'3ups-upu'; did you mean '3ups-upu-s'?"),
        (["missing.toml"], "missing.toml"),
        (["text.urdf"], "text.urdf"),
        (["a01-pendulum", "nothing"], "mechanism or model 'nothing'"),
        (["a01-pendulum", "--out", "text.urdf/page.html"], "text.urdf/page.html: cannot be written"),
        (["a01-pendulum", "--out", "."], ".: is a folder; choose a file name"),
        (["a01-pendulum", "--png", "a.jpg"], "cannot write a.jpg; "),
        (["a01-pendulum", "--out", "a.html", "--png", "b.png"], "--out and --png cannot be combined"),
        (["a01-pendulum", "--pdf", "a.svg"], "cannot write a.svg; "),
        (["a01-pendulum", "--port", "70000"], "cannot serve on port 70000"),
    ],
)
def test_bad_input_is_one_sentence(arguments, said, tmp_path, inside, command) -> None:
    Path("text.urdf").write_text("no model", encoding="utf-8")
    told = command("view", *arguments, status=2)
    assert said in told.err
    assert "Traceback" not in told.err
    assert {path.name for path in tmp_path.iterdir()} == {"text.urdf"}


def test_a_port_that_is_taken_is_said(capsys) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert main(["view", "a01-pendulum", "--port", str(taken.getsockname()[1])]) == 2
    assert "(address already in use); omit --port" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="interrupts are sent otherwise")
def test_it_serves_one_page_to_this_machine_until_it_is_interrupted() -> None:
    command = [sys.executable, "-m", "screwgauge.cli", "view", "a01-pendulum"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as served:
        address = served.stdout.readline().split()[0]
        try:
            assert address.startswith("http://127.0.0.1:")
            with urllib.request.urlopen(address) as answer:
                assert answer.status == 200
                assert b"screwgaugeStage" in answer.read()
            for other in (
                urllib.request.Request(f"{address}etc/passwd"),
                urllib.request.Request(address, headers={"Host": "elsewhere.example:80"}),
            ):
                with pytest.raises(urllib.error.HTTPError, match="404"):
                    urllib.request.urlopen(other)
        finally:
            served.send_signal(signal.SIGINT)
        assert served.wait() == 0
        assert served.stderr.read() == ""


@pytest.mark.slow
def test_an_interrupt_that_a_library_swallows_ends_it_too(monkeypatch) -> None:
    monkeypatch.setattr(console, "_stopped_by", [signal.SIGINT])
    assert _serve(b"", 0) == 0


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    """A page in a real browser."""
    file = tmp_path_factory.mktemp("view") / "page.html"
    assert main(["view", "slider-crank", "--out", str(file)]) == 0
    with open_page(file, 600, 500) as shown:
        yield shown


#: Frames after which a busy machine has drawn what a click asks for.
FRAMES = 50


def seen(page: Any) -> bytes:
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return bytes(page.locator(".stage canvas").screenshot())


def test_the_mechanism_is_drawn_and_scrubbed_by_keys(opened) -> None:
    page = opened.page
    first = seen(page)
    assert len(first) > BLANK
    page.locator("input[type=range]").focus()
    for _ in range(20):
        page.keyboard.press("ArrowRight")
    assert seen(page) != first
    assert "t = 0.000 s" not in page.locator(".stage output").text_content()
    assert "crank = " in page.locator(".stage output").text_content()
    opened.check_quiet()


@pytest.mark.parametrize("group", ["axes", "frames", "masses", "ellipsoids", "actuators", "reactions", "wrenches"])
def test_each_box_shows_and_hides(opened, group) -> None:
    page = opened.page  # in the first frame no force of an actuator is seen
    page.evaluate("() => { const s = document.querySelector('input[type=range]'); s.value = 20; s.oninput(); }")
    before = seen(page)
    page.click(f"input[name={group}]")
    assert any(seen(page) != before for _ in range(FRAMES))
    page.click(f"input[name={group}]")
    assert any(seen(page) == before for _ in range(FRAMES))
    opened.check_quiet()


def test_it_plays_to_the_end_and_turns_with_the_mouse(opened) -> None:
    page = opened.page
    page.evaluate("() => { const s = document.querySelector('input[type=range]'); s.value = s.max - 2; s.oninput(); }")
    page.click(".stage button")
    page.evaluate(
        "new Promise(done => { const s = document.querySelector('input[type=range]'), look = () => "
        "s.value === s.max ? done() : requestAnimationFrame(look); look(); })"
    )
    before, box = seen(page), page.locator(".stage canvas").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 150)
    page.mouse.down()
    page.mouse.move(box["x"] + 260, box["y"] + 180, steps=4)
    page.mouse.up()
    assert seen(page) != before
    opened.check_quiet()
