import io
import json
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

from screwgauge import commands
from screwgauge.environment import json_text
from screwgauge.report.console import SIGNS, complain, console, mark, say
from support.command import main
from support.errors import OutputError
from support.pages import Banner, Items, Table, Text, terminal

LIST = [sys.executable, "-m", "screwgauge.cli", "list", "quantities"]
STOP = "import os, signal\nfrom screwgauge import commands, cli\n"


@pytest.fixture
def command(monkeypatch):
    def run(work, *arguments: str) -> int:
        def list_(options):
            return work()

        monkeypatch.setattr(commands, "list_", list_)
        return main(["list", *arguments])

    return run


def shell(redirected: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    whole = ["bash", "-c", f'exec "$@" {redirected}', "bash", *LIST]
    return subprocess.run(whole, capture_output=True, check=False, env={**os.environ, **environment})


def test_a_stream_that_knows_no_signs_gets_others_of_the_same_length():
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    with pytest.MonkeyPatch.context() as patch, console():
        patch.setattr(sys, "stdout", stream)
        with console():
            say(f"{''.join(SIGNS)} N·m é \udcff|")
    assert stream.buffer.getvalue().decode() == f"{''.join(SIGNS.values())} N.m ?  |\n"
    assert all(len(other) == 1 and other.isascii() for other in SIGNS.values())


#: What a name may be that means to be obeyed, by itself or once a line is wrapped before it.
NAMES = ("::error::x", "  ::stop-commands::tok", ":::debug::x", "a\n::error file=x::y", "x ##[error]y", "##vso[task]z")


def obeyed(printed: str) -> list[str]:
    return [line for line in printed.splitlines() if line.lstrip().startswith("::") or re.search(r"##(vso)?\[", line)]


@pytest.mark.parametrize("name", NAMES)
def test_no_name_in_the_output_is_a_command_to_a_ci_service(name, capsys, command):
    texts = [f"{'x' * length} {name}" for length in range(80, 102)]
    blocks = [
        Text(name),
        Banner(name),
        Items(tuple(texts)),
        Table(("", name), ((name, name * 9),)),
        *map(Text, texts),
    ]
    say(name)
    complain(name)
    say(terminal(blocks))
    say(json_text({name: name}, escaped=True))

    def breaks() -> int:
        raise OutputError(name, name, name)

    for debug in ((), ("--debug",)):
        command(breaks, *debug)
    for typed in (f"--{name}", name):
        with suppress(SystemExit):  # of argparse
            main(["list", "scenes", typed])
    printed = capsys.readouterr()
    assert obeyed(printed.out) == obeyed(printed.err) == obeyed(terminal(blocks)) == []


def test_json_says_a_name_that_would_be_obeyed_as_it_is(capsys):
    say(json_text({"##[a]": "x ###vso[y"}, escaped=True))
    assert json.loads(capsys.readouterr().out) == {"##[a]": "x ###vso[y"}


def test_a_command_to_a_ci_service_is_one_line(capsys):
    mark("::error file=a,line=1::b\n::stop-commands::c")
    assert capsys.readouterr().out == "::error file=a,line=1::b ::stop-commands::c\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("redirected", "status", "said"),
    [
        (">&-", 2, "screwgauge: cannot write to standard output"),
        (">/dev/full", 2, "screwgauge: cannot write to standard output"),
        ("2>&-", 0, ""),
        ("2>/dev/full", 0, ""),
        ("<&- 2>&-", 0, ""),
    ],
)
def test_streams_that_are_closed_or_full(redirected, status, said):
    done = shell(redirected)
    assert done.returncode == status
    assert done.stderr.decode().startswith(said)
    assert done.stderr.count(b"\n") == (1 if said else 0)
    assert (b"joint_position" in done.stdout) is not bool(said)


@pytest.mark.slow
def test_a_terminal_in_ascii_is_no_error():
    done = shell("", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"joint_position" in done.stdout


def test_help_on_a_full_disk_is_one_sentence():
    done = subprocess.run(
        ["bash", "-c", 'exec "$@" >/dev/full', "bash", *LIST[:3], "--help"], capture_output=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("by\nzero"), MemoryError(), RecursionError("x" * 9999), SystemExit(0)]
)
def test_what_nobody_foresaw_is_one_sentence_and_exit_3(error, command, capfd):
    def work():
        raise error

    assert command(work) == 3
    said = capfd.readouterr().err
    assert said.startswith("screwgauge: this should not")
    assert said.endswith("run the command again with --debug and report the traceback.\n")
    assert said.count("\n") == 1
    assert command(work, "--debug") == 3
    assert "Traceback" in capfd.readouterr().err


@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
@pytest.mark.parametrize("hidden", [False, True])
def test_a_signal_ends_with_one_sentence_whatever_a_library_makes_of_it(number, word, hidden, command, capfd):
    def work():
        try:
            os.kill(os.getpid(), number)
            raise AssertionError
        except KeyboardInterrupt:
            if hidden:  # as numpy does while it is imported
                raise ImportError("numpy") from None
            raise

    before = signal.getsignal(number)
    assert command(work) == 128 + number
    assert capfd.readouterr().err == f"screwgauge: {word}; nothing was written.\n"
    assert signal.getsignal(number) is before
    assert command(lambda: 0) == 0


def test_ctrl_c_while_arguments_are_read(monkeypatch, capfd):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr("screwgauge.cli._parser", interrupted)
    assert main(["list"]) == 130
    assert capfd.readouterr().err == "screwgauge: interrupted; nothing was written.\n"


@pytest.mark.parametrize("arguments", [["run", "3ups-upu-s"], ["bench", "3ups-upu-s"]])
def test_a_stopped_command_says_what_is_left_and_cleans_up(arguments, tmp_path, monkeypatch, capfd):
    def stopped(*given, **more):
        os.kill(os.getpid(), signal.SIGTERM)

    for place in ("api.run", "study.bench.run.bench"):
        monkeypatch.setattr(f"screwgauge.{place}", stopped)
    out = tmp_path / "out"
    assert main([*arguments, "--out", str(out)]) == 143
    left = {"run": "nothing was written"}.get(arguments[0], "run the same command again")
    assert capfd.readouterr().err.startswith(f"screwgauge: terminated; {left}")
    assert not out.exists()
