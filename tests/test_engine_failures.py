import json
import sys
from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.command import main
from support.engines import ENGINES, Values, ask, model_files

QUANTITIES = ["joint_position", "generalized_force", "actuator_force"]


@pytest.fixture
def elsewhere(monkeypatch):
    def put(source: str, *names: str) -> None:
        for name in names:
            monkeypatch.setitem(ENGINES, name, replace(ENGINES[name], source=source))

    return put


def raising(error: BaseException):
    def fail(problem):
        raise error

    return fail


def check_only_mujoco_failed(results, reason: str) -> None:
    assert results.exit_status == 3
    assert not results.ok
    assert list(results.solutions) == ["screw", "pinocchio"]
    assert list(results.failures) == ["mujoco"]
    assert reason in results.failures["mujoco"].reason
    failed = (results.pairs["a"] == "mujoco") | (results.pairs["b"] == "mujoco")
    for other in ("screw", "pinocchio"):
        rows = results.pairs[failed & ((results.pairs["a"] == other) | (results.pairs["b"] == other))]
        assert set(rows["quantity"]) == set(QUANTITIES)
        assert not rows["ok"].any()
        assert rows["max_scaled"].isna().all()
        assert rows["reason"].str.contains(reason, regex=False).all()
    assert results.pairs[~failed]["ok"].all()
    assert set(results.pairs[~failed]["quantity"]) == set(QUANTITIES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "error",
    [ValueError("bad pose"), RuntimeError("bad\npose"), MemoryError("bad pose"), AssertionError("bad pose"),
     ZeroDivisionError("bad pose"), OSError(5, "bad pose"), KeyError("bad pose"), np.linalg.LinAlgError("bad pose")],
    ids=lambda error: type(error).__name__,
)  # fmt: skip
def test_an_engine_that_raises_is_rows_with_the_reason(error, stand_in, scene):
    stand_in(mujoco=raising(error))
    check_only_mujoco_failed(screwgauge.run(scene, quantities=QUANTITIES), "bad pose")


def test_the_reason_names_the_kind_of_error(stand_in, scene):
    stand_in(mujoco=raising(ZeroDivisionError("x")))
    assert "ZeroDivisionError" in screwgauge.run(scene, quantities=QUANTITIES).failures["mujoco"].reason


@pytest.mark.parametrize("target", ["no_such_module_at_all:load", "screwgauge.engines.nothing:load"])
def test_an_engine_that_is_not_installed_is_rows_that_say_how_to_get_it(target, elsewhere, scene):
    elsewhere(target, "mujoco")
    results = screwgauge.run(scene, quantities=QUANTITIES)
    check_only_mujoco_failed(results, "not installed")
    assert "pip install" in results.failures["mujoco"].reason


@pytest.mark.parametrize(("name", "package"), [("pinocchio", "pin"), ("mujoco", "mujoco")])
def test_the_package_to_install_is_named_as_the_index_calls_it(name, package, monkeypatch, scene):
    monkeypatch.delitem(sys.modules, f"screwgauge.engines.{name}.model", raising=False)
    monkeypatch.setitem(sys.modules, name, None)  # what an import finds of a package that is not there
    results = screwgauge.run(scene, engines=["screw", name], quantities=QUANTITIES)
    assert results.exit_status == 3
    assert results.failures[name].reason.endswith(f"pip install {package}")


def test_an_engine_of_an_extra_is_installed_by_that(elsewhere, monkeypatch, scene, command):
    elsewhere("no_such_module_at_all:load", "mujoco")
    monkeypatch.setitem(ENGINES, "mujoco", replace(ENGINES["mujoco"], package="no-such-package", extra="physics"))
    reason = screwgauge.run(scene, quantities=QUANTITIES).failures["mujoco"].reason
    assert reason == "not installed (No module named 'no_such_module_at_all'); pip install 'screwgauge[physics]'"
    assert "pip install 'screwgauge[physics]'" in command("list", "engines").out


def test_a_package_that_is_there_but_cannot_be_loaded_is_to_be_installed_anew(stand_in, scene):
    error = ImportError("libx.so.4: no such file")
    stand_in(pinocchio=raising(error))
    reason = screwgauge.run(scene, quantities=QUANTITIES).failures["pinocchio"].reason
    assert reason == f"cannot be loaded ({error}); pip install --force-reinstall pin"


@pytest.mark.slow
@pytest.mark.parametrize(
    "target", ["screwgauge.engines.screw.model:nothing", "screwgauge.engines.screw.model", "json:dumps"]
)
def test_an_engine_that_is_registered_wrongly_is_a_row(target, elsewhere, scene):
    elsewhere(target, "mujoco")
    check_only_mujoco_failed(screwgauge.run(scene, quantities=QUANTITIES), "")


def solve_right(problem):
    return ask("screw", model_files("3ups-upu-s", "screw"), problem)


def cut_short(problem):
    found = solve_right(problem)
    return replace(
        found, values={k: Values(v.components, v.units, v.array[1:].copy()) for k, v in found.values.items()}
    )


def test_the_stand_in_for_an_engine_is_accepted_when_it_answers_in_full(stand_in, scene):
    stand_in(mujoco=solve_right)
    assert screwgauge.run(scene, quantities=QUANTITIES).exit_status == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("answer", "reason"),
    [(lambda problem: None, "TypeError"), (lambda problem: {}, "TypeError"), (cut_short, "has 1 samples")],
    ids=["None", "dict", "short"],
)
def test_an_engine_that_returns_no_solution_is_a_row(answer, reason, stand_in, scene):
    stand_in(mujoco=answer)
    check_only_mujoco_failed(screwgauge.run(scene, quantities=QUANTITIES), reason)


@pytest.mark.parametrize(
    ("components", "units", "shape"),
    [(("a",), ("m",), (2, 2)), (("a", "b"), ("m",), (2, 2)), (("a",), ("m",), (2,))],
)
def test_values_have_a_name_and_a_unit_for_every_column(components, units, shape):
    with pytest.raises(ValueError, match="values for"):
        Values(components, units, np.zeros(shape))


def test_an_engine_that_returns_nan_is_out_of_tolerance_and_says_where(stand_in, scene):
    def with_nan(problem):
        found = solve_right(problem)
        array = found.values["joint_position"].array.copy()
        array[1, 2] = np.nan
        values = found.values["joint_position"]
        return replace(found, values={**found.values, "joint_position": Values(values.components, values.units, array)})

    stand_in(mujoco=with_nan)
    results = screwgauge.run(scene, quantities=QUANTITIES)
    assert results.exit_status == 1
    rows = results.pairs[(results.pairs["quantity"] == "joint_position") & (results.pairs["b"] == "mujoco")]
    lost = rows[rows["worst_component"] == "leg1.q3"]
    assert len(lost) == 2
    assert not lost["ok"].any()
    assert (lost["worst_t"] == 0.5).all()
    assert lost["reason"].str.contains("not a number").all()


def test_interrupting_is_no_failure_of_an_engine(stand_in, scene):
    stand_in(mujoco=raising(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        screwgauge.run(scene, quantities=QUANTITIES)


def test_an_interrupted_run_writes_nothing(stand_in, paper_scene, tmp_path, capfd):
    stand_in(mujoco=raising(KeyboardInterrupt()))
    path = paper_scene()
    assert main(["run", str(path), "--out", str(tmp_path / "out")]) == 130
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
@pytest.mark.parametrize("broken", [["mujoco"], ["pinocchio", "mujoco"], ["screw", "pinocchio", "mujoco"]])
def test_the_report_is_written_all_the_same(broken, elsewhere, paper_scene, tmp_path, command, no_progress):
    elsewhere("no_such_module_at_all:load", *broken)
    out = tmp_path / "out"
    names = ",".join(QUANTITIES)
    said = command("run", str(paper_scene()), "--quantities", names, "--out", out, status=3)
    assert said.err == ""
    assert "FAILED" in said.out
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert not summary["ok"]
    for file in ("report.md", "report.html"):
        report = (out / file).read_text(encoding="utf-8")
        for name in broken:
            assert name in report
        assert "not installed" in report
    for name in ("errors.csv", "timings.csv", "environment.json"):
        assert (out / name).is_file()
