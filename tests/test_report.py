import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from screwgauge import Results
from screwgauge.judging.coverage import Coverage
from screwgauge.reference.mobility import Mobility
from screwgauge.report import folder as writing
from screwgauge.report.figures import run as drawing
from screwgauge.report.figures.drawings import named_drawings
from screwgauge.scene.entries import Figure
from screwgauge.study.left_out import LeftOutForces
from support.acting import Applied, Load
from support.engines import Failure, Solution, Timing, Values
from support.errors import OutputError
from support.mechanism import load_mechanism
from support.pages import Group, Picture, Table, fragment, terminal
from support.report import default_figures, first_difference, verdict
from support.report import run_page as page
from support.scene import GivenMotion

N = 400
NAMES = ("leg1.q1", "leg1.q2", "leg2.q1", "leg2.q2")
TOLERANCE = 1e-11
PROVENANCE = {
    "models": {"alpha": {"file": "robot.xml", "sha256": "12ab"}},
    "scene_file": "toy.toml",
    "scene_sha256": "34cd",
    "description": {"file": "built-in toy.toml", "sha256": "56ef"},
    "date": "2020-02-02T02:02:02+00:00",
    "schema": 1,
}
Make = Callable[..., Results]


@pytest.fixture(autouse=True)
def _no_mechanism(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = Picture("mechanism", "A toy", "<svg ></svg>")
    monkeypatch.setattr("screwgauge.report.pages.run.stage", lambda *given: drawn)


def solution(engine: str, change: float, n: int, nan: bool) -> Solution:
    t = np.linspace(0.0, 1.0, n)
    position = np.column_stack([np.sin(t + k) for k in range(4)])
    velocity = np.column_stack([np.cos(t + k) for k in range(4)])
    velocity[n // 2, 2] += change
    if nan:
        velocity[: n // 3, 1] = np.nan
    values = {
        "joint_position": Values(NAMES, ("rad",) * 4, position),
        "joint_velocity": Values(NAMES, ("rad/s",) * 4, velocity),
    }
    timing = Timing(engine, "default", "kinematics", n, 0.25, 0.5, "closure, rates")
    return Solution(engine, "1.2.3", values, 3.0 + t, (timing,), (f"a note of {engine}",))


def row(quantity: str, unit: str, a: Solution, b: Solution, name: str) -> dict[str, Any]:
    k = NAMES.index(name)
    difference = np.abs(a.values[quantity].array[:, k] - b.values[quantity].array[:, k])
    i = int(np.argmax(difference))  # of NaN the first NaN
    worst = float(difference[i])
    return {
        "quantity": quantity,
        "component": name,
        "unit": unit,
        "a": a.engine,
        "b": b.engine,
        "max_abs": worst,
        "rms": worst / 2,
        "max_scaled": worst / 2,
        "scale": 2.0,
        "worst_t": i / (N - 1),
        "rule": "",
        "unique": True,
        "tolerance": TOLERANCE,
        "ok": bool(worst / 2 <= TOLERANCE),
        "undecided": 0,
    }


def worst_of(rows: list[dict[str, Any]]) -> dict[str, Any]:
    worst = max(rows, key=lambda r: np.inf if np.isnan(r["max_abs"]) else r["max_abs"])
    reason = "not a number" if np.isnan(worst["max_abs"]) else ""
    return {**worst, "worst_component": worst["component"], "reason": reason}


def judged(engine: str, ok: bool = True) -> dict[str, Any]:
    return {
        "engine": engine,
        "residual": "loop_closure",
        "unit": "m",
        "max_abs": 1e-15,
        "max_scaled": 1e-15,
        "worst_component": "leg2.wrist",
        "worst_t": 0.5,
        "tolerance": TOLERANCE,
        "ok": ok,
        "undecided": 0,
        "reason": "",
    }


def scene(n: int, figures: tuple[Figure, ...]) -> Any:
    mechanism = replace(load_mechanism("slider-crank"), name="toy", title="A toy", source="")
    task = GivenMotion(np.linspace(0.0, 1.0, n), *(np.zeros((n, 1)) for _ in range(3)))
    load = Load("platform", None, np.array([0.0, 0.0, 1000.0]), np.zeros(3))
    return SimpleNamespace(
        name="toy",
        title="Toy | scene <one>",
        description="Two legs that swing.",
        mechanism=mechanism,
        applied=Applied(np.array([0.0, 0.0, -9.81]), (load,)),
        task=task,
        t=task.t,
        simulated=False,
        grid=None,
        undriven=(),
        published=(),
        tables={},
        rule="min_norm",
        figures=figures,
        allow=(),
        text={"motion": {"a": {"offset": 0, "harmonics": [["1.5", 0, "pi/3"]]}}},
    )


@pytest.fixture
def make() -> Make:
    def build(
        change: float = 0.0,
        *,
        n: int = N,
        nan: bool = False,
        alone: bool = False,
        fails: bool = False,
        judge_ok: bool = True,
        figures: tuple[Figure, ...] = (),
    ) -> Results:
        first, second = solution("alpha", 0.0, n, False), solution("beta", change, n, nan)
        solutions = {"alpha": first} if alone or fails else {"alpha": first, "beta": second}
        errors, pairs = [], []
        if len(solutions) == 2:
            for quantity, unit in (("joint_position", "rad"), ("joint_velocity", "rad/s")):
                rows = [row(quantity, unit, first, second, name) for name in NAMES]
                errors += rows
                pairs.append(worst_of(rows))
        if fails:
            nothing = row("joint_position", "rad", first, first, NAMES[0])
            lost = {
                **nothing,
                "b": "beta",
                "max_abs": np.nan,
                "rms": np.nan,
                "max_scaled": np.nan,
                "ok": False,
            }
            pairs.append({**lost, "worst_component": "", "worst_t": np.nan, "reason": "it is not installed"})
        columns = [*row("joint_position", "rad", first, first, NAMES[0])]
        return Results(
            scene=scene(n, figures),
            solutions=solutions,
            failures={"beta": Failure("beta", "it is not installed")} if fails else {},
            errors=pd.DataFrame(errors, columns=columns),
            pairs=pd.DataFrame(pairs, columns=[*columns, "worst_component", "reason"]),
            judge=pd.DataFrame([judged(name, judge_ok) for name in solutions]),
            remarks={},
            freedoms=Mobility(0, 0, 0, 2, 0, 0, 0, 0, ("a", "b"), (True, False), (True, True)),
            provenance=PROVENANCE,
            refusals=(),
            left_out=LeftOutForces(),
            review=dict,
            cover=Coverage,
        )

    return build


def read(folder: Path) -> dict[str, Any]:
    def refuse(name: str) -> None:
        raise ValueError(f"{name} is not JSON")

    text = (folder / "summary.json").read_text(encoding="utf-8")
    result: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return result


def test_summary_follows_the_contract(make: Make, tmp_path: Path) -> None:
    found = read(make(1e-8).write(tmp_path / "out"))
    fixed = ["scene", "ok", "engines", "quantities", "judge", "timings", "environment"]
    judged_files = ["models", "scene_file", "scene_sha256", "description", "date", "schema"]
    told = [
        "coverage",
        "failures",
        "first_difference",
        "guard",
        "known",
        "refused",
        "tables",
        "warnings",
        "engine_warnings",
    ]
    told += ["not_unique", "forces", "outcomes", "undecided", "left_out", "left_out_contained"]
    assert set(found) == {*fixed, *judged_files, *told}
    assert {key: found[key] for key in judged_files} == PROVENANCE
    assert found["scene"] == "toy"
    assert found["ok"] is False
    assert found["engines"] == {"alpha": "1.2.3", "beta": "1.2.3"}
    keys = ["quantity", "a", "b", "unit", "max_abs", "rms", "max_scaled", "worst"]
    assert list(found["quantities"][1]) == [*keys, "rule", "unique", "tolerance", "ok"]
    assert found["quantities"][1]["worst"] == {"component": "leg2.q1", "t": pytest.approx(200 / 399)}
    keys = ["engine", "residual", "unit", "max_abs", "max_scaled", "tolerance", "ok"]
    assert list(found["judge"][0]) == keys
    keys = ["engine", "setting", "stage", "n_sample", "min_s", "median_s", "covers"]
    assert list(found["timings"][0]) == keys


def test_tables_follow_the_contract(make: Make, tmp_path: Path) -> None:
    out = make(1e-8).write(tmp_path / "out")
    head = "quantity,component,unit,a,b,max_abs,rms,max_scaled,scale,worst_t,rule,unique,tolerance,ok"
    lines = (out / "errors.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == head
    assert len(lines) == 1 + 2 * len(NAMES)
    head = "engine,setting,stage,n_sample,min_s,median_s,covers"
    assert (out / "timings.csv").read_text(encoding="utf-8").splitlines()[0] == head
    assert json.loads((out / "environment.json").read_text(encoding="utf-8"))["packages"]["numpy"]


def test_error_table_gives_back_every_bit(make: Make, tmp_path: Path) -> None:
    results = make(1e-8)
    with (results.write(tmp_path / "out") / "errors.csv").open(encoding="utf-8", newline="") as file:
        back = [float(row["max_scaled"]) for row in csv.DictReader(file)]
    assert back == results.errors["max_scaled"].tolist()


def test_not_a_number_is_valid_json_and_a_failure(make: Make, tmp_path: Path) -> None:
    results = make(nan=True)
    out = results.write(tmp_path / "out")
    found = read(out)
    assert found["quantities"][1]["max_abs"] is None
    assert found["quantities"][1]["ok"] is False
    assert found["first_difference"]["size"] is None
    assert "joint_velocity at leg1.q2 (not a" in verdict(results).text
    pictures = " ".join(path.read_text(encoding="utf-8") for path in out.glob("plots/*.svg"))
    assert f"beta has no values at {N // 3} of {N}" in pictures


def test_verdict_names_the_first_quantity(make: Make) -> None:
    results = make(1e-8)
    sentence = verdict(results).text
    assert "joint_velocity at leg2.q1, by 1.0e-8 rad/s" in sentence
    first = first_difference(results)
    assert first is not None
    assert [first[key] for key in ("quantity", "component", "a", "b")] == [
        *("joint_velocity", "leg2.q1", "alpha", "beta")
    ]
    assert first["size"] == pytest.approx(5e-9, rel=1e-6)


def test_verdict_of_agreement_counts_digits(make: Make) -> None:
    found = verdict(make())
    assert (found.status, found.word) == ("agree", "✓ AGREE")
    assert "all 2 comparisons" in found.text
    assert "17.0 digits" in found.text
    assert first_difference(make()) is None


def test_verdict_names_the_judge_too(make: Make) -> None:
    alone = verdict(make(judge_ok=False)).text
    assert "alpha: loop closure residual" in alone
    assert alone.endswith("tolerance 1e-11) at leg2.wrist, t = 0.5 s.")
    both = verdict(make(1e-8, judge_ok=False)).text
    assert "differ: first in" in both
    assert "judge faults" in both


def test_a_failed_engine_is_said_first_with_its_reason(make: Make, tmp_path: Path) -> None:
    results = make(fails=True)
    found = verdict(results)
    assert found.status == "failed"
    assert "beta: it is not installed." in found.text
    out = results.write(tmp_path / "out")
    assert read(out)["failures"] == {"beta": "it is not installed"}
    assert read(out)["first_difference"] is None
    assert "it is not installed" in (out / "report.md").read_text(encoding="utf-8")


def test_one_engine_alone_is_only_judged(make: Make, tmp_path: Path) -> None:
    results = make(alone=True)
    assert "nothing to compare it with" in verdict(results).text
    text = (results.write(tmp_path / "out") / "report.md").read_text(encoding="utf-8")
    assert "there are no pairs" in text
    assert "quantity " not in terminal(page.terminal(results))


def test_report_puts_the_verdict_first(make: Make, tmp_path: Path) -> None:
    text = (make(1e-8).write(tmp_path / "out") / "report.md").read_text(encoding="utf-8")
    assert text.splitlines()[2].startswith("> **✗ DIFFER** alpha and beta differ")
    heads = re.findall(r"^## (.*)$", text, flags=re.MULTILINE)
    assert heads[:5] == ["Out of tolerance", "Digits of agreement", "Judge", "Plots", "Coverage"]
    appendix = ["Scene", "Engines", "Pairs", "Residuals", "Estimated errors", "Parameters", "Mechanism"]
    assert heads[5:] == [*appendix, "How it was compared", "Run times", "Environment", "Known limitations", "Glossary"]
    assert "a note of beta" in text


def test_report_links_every_plot_it_wrote(make: Make, tmp_path: Path) -> None:
    out = make().write(tmp_path / "out")
    linked = re.findall(r"\]\((plots/.*?)\)", (out / "report.md").read_text(encoding="utf-8"))
    assert sorted(linked) == sorted(str(path.relative_to(out)) for path in out.glob("plots/*"))
    assert len(linked) == 4  # the mechanism, two quantities and the condition number


def test_html_is_one_file_without_outside_references(make: Make, tmp_path: Path) -> None:
    text = (make(1e-8).write(tmp_path / "out") / "report.html").read_text(encoding="utf-8")
    page = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)  # what these ask for, a browser's test sees
    assert page.count("<svg ") == 4
    for pattern in (r"<(?:link|iframe|img|object)\b", r"@import", r"src=", r"url\((?!#)"):
        assert not re.search(pattern, page), pattern
    assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', page))
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]*)"', page)) | set(re.findall(r"url\(#([^)]*)\)", page)) <= set(ids)
    assert "<title>Toy | scene &lt;one&gt;: verification report</title>" in page


@pytest.mark.slow
def test_written_twice_is_the_same(make: Make, tmp_path: Path) -> None:
    first, second = make(1e-8).write(tmp_path / "one"), make(1e-8).write(tmp_path / "two")
    names = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert names == sorted(path.relative_to(second) for path in second.rglob("*") if path.is_file())
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_a_file_in_place_of_the_folder_is_one_sentence(make: Make, tmp_path: Path, below: str) -> None:
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    out = tmp_path / "out" / below
    for attempt in (lambda: make().write(out), lambda: writing.check_writable(out)):
        with pytest.raises(OutputError, match="cannot write to the folder") as caught:
            attempt()
        assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


def test_nothing_is_half_written(make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = make().write(tmp_path / "out")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    write, count = Path.write_text, iter(range(100))

    def full(self: Path, *args: Any, **kwargs: Any) -> int:
        if next(count) == 4:
            raise OSError(28, "No space left on device")
        return write(self, *args, **kwargs)

    monkeypatch.setattr(Path, "write_text", full)
    for folder in (out, tmp_path / "new"):
        count = iter(range(100))
        with pytest.raises(OutputError, match="no space left"):
            make(1e-8).write(folder)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_folder_in_the_way_of_a_file_leaves_the_rest_alone(make: Make, tmp_path: Path) -> None:
    (tmp_path / "out" / "report.md").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"report\.md is a folder"):
        make().write(tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["report.md"]


def test_checking_a_folder_leaves_nothing(tmp_path: Path) -> None:
    writing.check_writable(tmp_path / "a" / "b")
    assert not list(tmp_path.iterdir())


def test_samples_without_pyarrow_are_refused_first(make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(writing, "find_spec", lambda name: None)
    with pytest.raises(OutputError, match="pyarrow"):
        make().write(tmp_path / "out", samples=True)
    assert not (tmp_path / "out").exists()


def test_samples_hold_every_value(make: Make, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    results = make(1e-8)
    frame = pd.read_parquet(results.write(tmp_path / "out", samples=True) / "samples.parquet")
    assert len(frame.columns) == 1 + 2 * 2 * len(NAMES)
    np.testing.assert_array_equal(frame["beta/joint_velocity/leg2.q1"], results.values("joint_velocity", "beta")[:, 2])


def test_engines_that_cannot_be_compared_are_not_drawn_over_each_other(make: Make, tmp_path: Path) -> None:
    results = make()
    out = replace(results, errors=results.errors.iloc[:0]).write(tmp_path / "out")
    picture = (out / "plots" / "01-joint-position.svg").read_text(encoding="utf-8")
    assert "Not drawn as curves," in picture
    assert "difference" not in picture


def test_a_single_sample_can_be_reported(make: Make, tmp_path: Path) -> None:
    text = (make(n=1).write(tmp_path / "out") / "report.md").read_text(encoding="utf-8")
    assert "1 sample, t = 0 s" in text


def test_samples_that_an_engine_did_not_solve_are_no_gap(make: Make) -> None:
    some = np.arange(0, N, 5)
    results = make(nan=True)
    beta = replace(results.solutions["beta"], rows=some)
    plots = drawing.make_plots(replace(results, solutions={**results.solutions, "beta": beta}))
    assert f"of {len(some)} samples" in plots[1].svg


def test_figures_of_one_quantity_in_two_units_are_told_apart() -> None:
    values = Values(("a", "b"), ("rad", "m"), np.ones((2, 2)))
    figures = default_figures({"alpha": Solution("alpha", "1", {"joint_position": values}, np.ones(2))})
    assert [figure.title for figure in figures] == ["Joint position [rad]", "Joint position [m]"]


def with_forces(results: Results) -> Results:
    t, names = results.times, ("a.fx", "a.fy", "a.mz", "b.fx", "b.fz")
    actuators = Values(("drive",), ("N m",), np.sin(7.0 * t)[:, None])
    array = np.column_stack([3.0 + t, 4.0 + t, 1e-15 * t, -2.0 - t, 9.0 + t])
    reactions = Values(names, ("N", "N", "N m", "N", "N"), array)
    more = {"actuator_force": actuators, "reaction": reactions}
    solutions = {name: replace(s, values={**s.values, **more}) for name, s in results.solutions.items()}
    counts = replace(results.freedoms, names=("b.fz",), unique=(False,), determined=(False,))
    return replace(results, solutions=solutions, freedoms=counts)


@pytest.mark.parametrize("alone", [False, True])
def test_the_size_of_forces_is_on_terminal_and_pages(make: Make, tmp_path: Path, alone: bool) -> None:
    results = with_forces(make(alone=alone))
    low, high = np.sin(7.0 * results.times).argmin(), np.sin(7.0 * results.times).argmax()
    times = [f"{results.times[i]:.4g}" for i in (low, high)]
    line = ["drive", "N·m", "-1", times[0], "1", times[1]]
    assert line in [text.split() for text in terminal(page.terminal(results)).splitlines()]
    out = results.write(tmp_path / "out")
    text = (out / "report.md").read_text(encoding="utf-8").partition("## Size of forces")[2].partition("\n## ")[0]
    assert "as alpha computed them" in text
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in text.splitlines() if row.startswith("| ")][2:]
    assert rows == [
        ["drive", "actuator moment", "N·m", "-1", times[0], "1", times[1], ""],
        ["a", "reaction force", "N", "5", "0", "6.403", "1", "fx fy"],
        ["a", "reaction moment", "N·m", "0", "0", "0", "1", "mz"],
        ["b", "reaction force", "N", "2", "0", "3", "1", "fx"],
    ]
    assert "6.403" in (out / "report.html").read_text(encoding="utf-8")
    (drive, *_, b) = read(out)["forces"]
    assert drive["max"] == pytest.approx(1.0, abs=1e-4)
    assert b["of"] == "b"


def test_what_is_no_number_has_no_part_in_the_size_of_forces(make: Make, tmp_path: Path) -> None:
    results = with_forces(make(alone=True))
    known = results.solutions["alpha"]
    drive, reaction = (known.values[name].array.copy() for name in ("actuator_force", "reaction"))
    drive[5:9], drive[9], reaction[:, 0] = np.nan, np.inf, np.nan
    holes = {"actuator_force": drive, "reaction": reaction}
    values = {name: replace(known.values[name], array=array) for name, array in holes.items()}
    results = replace(results, solutions={"alpha": replace(known, values={**known.values, **values})})
    first, *others = read(results.write(tmp_path / "out"))["forces"]
    assert first["max"] == pytest.approx(1.0, abs=1e-4)
    assert {(row["of"], row["what"]) for row in others} == {("a", "reaction moment"), ("b", "reaction force")}


def test_without_forces_there_is_no_section_of_them(make: Make, tmp_path: Path) -> None:
    assert "Size of forces" not in (make().write(tmp_path / "out") / "report.md").read_text(encoding="utf-8")


def test_the_open_tree_is_explained_where_it_has_the_fewest_digits_and_fills_one_line_of_the_worst(make: Make) -> None:
    results = make()
    pairs, judge = results.pairs.copy(), results.judge.copy()
    forces = "tree_force", "tree_force_soft"
    pairs["quantity"] = forces
    pairs["max_scaled"] = [1e-13, 1e-12]
    judge["residual"] = "tree_force_soft"
    solutions = {
        name: replace(one, values=dict(zip(forces, one.values.values(), strict=True)))
        for name, one in results.solutions.items()
    }
    found = replace(results, pairs=pairs, judge=judge, solutions=solutions)
    assert "tree_force_soft only" in verdict(found).text
    (front,) = [block for block in page.report(found) if isinstance(block, Group) and block.kind == "front"]
    worst = next(block for block in front.blocks if isinstance(block, Table))
    assert [line[0] for line in worst.body] == ["tree force soft"]
    wrong = replace(found, pairs=pairs.assign(ok=[True, False]))
    (front,) = [block for block in page.report(wrong) if isinstance(block, Group) and block.kind == "front"]
    worst = next(block for block in front.blocks if isinstance(block, Table))
    assert len(worst.body) == 2


def test_default_figures_show_every_component_once() -> None:
    values = Values(("leg1.q1", "leg1.q3", "leg2.q1", "s.q1"), ("rad", "m", "rad", "rad"), np.zeros((2, 4)))
    figures = default_figures({"alpha": Solution("alpha", "1", {"joint_position": values}, np.ones(2))})
    assert [(figure.unit, [label for label, _ in figure.panels]) for figure in figures] == [
        ("rad", [""]),
        ("m", [""]),
    ]


def test_the_first_screen_has_the_actuator_forces_or_what_differs_and_the_machine(make: Make) -> None:
    def picture(name: str, of: str = "", stage: str = "") -> Picture:
        return Picture(name, name, "<svg ></svg>", stage=stage, of=of)

    for error, first in ((0.0, "actuator"), (1e-8, "velocity")):
        results = make(error)
        forces = Values(("leg1",), ("N",), np.zeros((len(results.times), 1)))
        solutions = {
            name: replace(one, values={**one.values, "actuator_force": forces})
            for name, one in results.solutions.items()
        }
        found = replace(results, solutions=solutions)
        plots = [picture(name, one.quantity) for name, one in named_drawings(found).items()]
        machine = picture("m", stage='{"doubts": [], "shapes": [], "words": []}')
        (front,) = [
            block
            for block in page.report(found, [machine, *plots])
            if isinstance(block, Group) and block.kind == "front"
        ]
        shown = [block.name for block in front.blocks if isinstance(block, Picture)]
        assert [first in shown[0], shown[1:]] == [True, ["m"]]


def test_pictures_in_a_page_have_ids_of_their_own() -> None:
    svg = '<svg ><g id="x"/><use xlink:href="#x"/><g clip-path="url(#x)"/></svg>'
    shown = fragment([Picture("f1", "a <picture>", svg)])
    assert 'aria-label="a &lt;picture&gt;"' in shown
    assert ('id="f1-x"' in shown, 'href="#f1-x"' in shown, "url(#f1-x)" in shown) == (True, True, True)


def test_terminal_summary_fits_100_columns(make: Make) -> None:
    text = terminal(page.terminal(make(1e-8)))
    assert max(len(line) for line in text.splitlines()) <= 100
    assert text.startswith("✗ DIFFER: alpha and beta differ")
    line = next(line for line in text.splitlines() if line.startswith("joint_velocity"))
    assert line.split() == [
        "joint_velocity",
        "rad/s",
        "alpha",
        "-",
        "beta",
        "5.0e-9",
        "8.3",
        "1e-11",
        "✗",
        "no",
    ]
