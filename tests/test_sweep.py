import numpy as np
import pandas as pd
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main
from support.data import data
from support.errors import DescriptionError
from support.parameters import numbers
from support.sweep import CHUNK, Draw, consistent_bodies, read_plan, sweep, triangle_excess

PLAN = data("plan.toml")
SCENE = """
mechanism = "five-bar"
time = { duration = 1, step = 0.1 }
motion.left.harmonics = [[3, 0, 0.4]]
motion.right = { harmonics = [[4, -0.3, 0.2]], offset = 0.3 }
"""


@pytest.fixture
def plan(write):
    write("scene.toml", SCENE)

    def read(text=PLAN):
        return read_plan(write("sweep.toml", text))

    return read


WRONG = {
    "no scatter": PLAN.partition("[scatter]")[0],
    "a number that is not there": PLAN.replace("left.parent.x", "left.parent.w"),
    "two distributions": PLAN.replace("normal = 1e-3", "normal = 1e-3, uniform = 1"),
    "another distribution": PLAN.replace("normal", "cauchy"),
    "no size": PLAN.replace("1e-3", "0"),
    "a negative size": PLAN.replace("1e-3", "-1"),
    "a percentage of zero": PLAN.replace("left.parent.x", "left.parent.z").replace("1e-3", '"1 %"'),
    "a number twice": PLAN + '"left.crank.mass" = { normal = 0.1 }',
    "a number of a body twice": PLAN + '"bodies.left.crank" = { body = "1 %" }',
    "no count": PLAN.replace("40", "0"),
    "half a count": PLAN.replace("40", "1.5"),
    "another key": "variant = 3\n" + PLAN,
    "another design": "design = 'grid'\n" + PLAN,
    "another statistic": "statistics = ['median']\n" + PLAN,
    "another quantity": "quantities = ['torque']\n" + PLAN,
    "no scene": PLAN.replace("scene.toml", "nothing.toml"),
    "no body": PLAN + '"right.parent" = { body = "1 %" }',
}


@pytest.mark.parametrize("what", WRONG)
def test_a_plan_that_cannot_be_is_refused(what, plan):
    with pytest.raises(ScrewgaugeError):
        plan(WRONG[what])


def test_numbers_that_cost_mobility_are_refused_before_any_variant(plan):
    with pytest.raises(DescriptionError, match=r"left\.parent\.tilt1"):
        sweep(plan(PLAN.replace("left.parent.x", "left.parent.tilt1")))


@pytest.mark.parametrize("design", ["random", "sobol"])
def test_a_draw_is_a_function_of_its_place_alone(design, plan):
    draw = Draw(plan(f"design = '{design}'\n" + PLAN))
    whole = draw.values(range(40))
    parts = np.concatenate([draw.values(range(i, min(i + 7, 40))) for i in range(0, 40, 7)], axis=1)
    assert np.array_equal(whole, parts)
    assert np.abs(whole[1:] / whole[1:].mean(axis=1, keepdims=True) - 1.0).max() < 0.1


def test_scatter_is_as_wide_as_the_plan_says(plan):
    draw = Draw(plan(PLAN.replace("40", "20000")))
    values = draw.values(range(20000))
    known = numbers(draw.plan.scene.mechanism)
    assert values[0].mean() == pytest.approx(known["joints.left.parent.x"], abs=3e-5)
    assert values[0].std() == pytest.approx(1e-3, rel=0.02)
    for name, some in zip(draw.names[1:], values[1:], strict=True):
        assert some.std() == pytest.approx(0.05 * known[name] / 3**0.5, rel=0.02)
        assert np.abs(some / known[name] - 1.0).max() <= 0.05


@pytest.mark.parametrize("body", [[2, 0.1, 0.2, -0.1, 0.02, 0.001, 0, 0.03, 0, 0.04], [1, 0, 0, 0.5, *[0] * 6]])
def test_bodies_that_scatter_can_exist(body):
    """Also a point mass, whose pseudo-inertia is singular."""
    found = consistent_bodies(np.array(body, dtype=float), 0.2 * np.random.default_rng(0).normal(size=(10, 200)))
    assert consistent_bodies(np.array(body, dtype=float), np.zeros((10, 1)))[:, 0] == pytest.approx(body, abs=1e-15)
    for mass, *_, xx, xy, xz, yy, yz, zz in found.T:
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert mass > 0.0
        assert np.linalg.eigvalsh(tensor).min() > -1e-12
        assert triangle_excess(tensor) < 1e-12


def test_rows_are_those_of_scenes_of_their_own(plan):
    found = sweep(plan())
    table = found.table
    assert len(table) == 40
    assert found.exit_status == 0
    for i in (0, 39):
        scene = found.plan.scene.with_({name: float(table[name][i]) for name in Draw(found.plan).names})
        force = screwgauge.run(scene, ["screw"], ["actuator_force"]).values("actuator_force", engine="screw")
        peaks = [table[column.name][i] for column in found.columns if column.statistic == "peak"]
        assert peaks == pytest.approx(np.abs(force).max(axis=0), rel=1e-12, abs=0)


def test_effects_are_the_spread_of_small_scatter(plan):
    found = sweep(plan(PLAN.replace("40", "3000").replace("1e-3", "1e-5").replace("5 %", "0.05 %")))
    expected = np.sqrt(sum(effect.changes**2 for effect in found.effects))
    assert np.nanstd(found.values, axis=0) == pytest.approx(expected, rel=0.05)
    assert np.abs(found.ranked[0][0].changes).max() == max(np.abs(effect.changes).max() for effect in found.effects)


def test_sobol_indices_of_a_linear_sum_are_shares_of_its_variance(plan):
    """Forces are linear in masses: no interaction, and shares are squares of effects."""
    text = "indices = 512\nstatistics = ['mean']\n" + PLAN.replace('"left.parent.x" = { normal = 1e-3 }', "")
    found = sweep(plan(text))
    spread = np.nanstd(found.values, axis=0) / found.sizes
    column = int(np.argmax(spread))
    squares = np.array([effect.changes[column] ** 2 for effect in found.effects])
    for (_, (first, total)), share in zip(found.indices.items(), squares / squares.sum(), strict=True):
        assert first == pytest.approx(share, abs=0.05)
        assert total == pytest.approx(share, abs=0.05)


def test_a_grid_is_a_product(plan):
    text = PLAN.partition("[scatter]")[0].replace("40", "1") + (
        '[grid]\n"left.crank.mass" = { from = 1, to = 2, count = 3 }\n"gravity.y" = { values = [0, -9.81] }\n'
    )
    found = sweep(plan(text))
    assert found.table["bodies.left.crank.mass"].tolist() == [1, 1, 1.5, 1.5, 2, 2]
    assert found.table["gravity.y"].tolist() == [0, -9.81] * 3


def test_a_sweep_goes_on_where_it_stopped(plan, tmp_path, monkeypatch):
    monkeypatch.setattr("screwgauge.study.sweep.run.CHUNK", 10)
    whole, done = sweep(plan(), place=tmp_path / "a").table, []

    def stopped(tasks, keep, report):
        for name, task in tasks.items():
            if len(done) == 2:
                raise KeyboardInterrupt
            done.append(name)
            keep(name, task.work(lambda share: None))

    with pytest.raises(KeyboardInterrupt):
        sweep(plan(), place=tmp_path / "out", execute=stopped)
    done.clear()

    def counted(tasks, keep, report):
        for name, task in tasks.items():
            done.append(name)
            keep(name, task.work(lambda share: None))

    again = sweep(plan(), place=tmp_path / "out", execute=counted).table
    assert len(done) == 2
    assert again.equals(whole)
    assert CHUNK > 1000


def test_a_chunk_that_is_lost_costs_its_rows(plan, monkeypatch):
    monkeypatch.setattr("screwgauge.study.sweep.run.CHUNK", 20)

    def first_alone(tasks, keep, report):
        from screwgauge.solution import Failure

        (one, work), (other, _) = tasks.items()
        keep(one, work.work(lambda share: None))
        keep(other, Failure(other, "killed"))

    found = sweep(plan(), execute=first_alone)
    assert (found.why[:20] == "").all()
    assert all("killed" in reason for reason in found.why[20:])
    assert np.isnan(found.values[20:]).all()


def test_the_command_writes_table_and_page(plan, tmp_path, capfd):
    path = plan().file
    assert main(["sweep", str(path), "--out", str(tmp_path / "out")]) == 0
    table = pd.read_csv(tmp_path / "out" / "variants.csv")
    assert len(table) == 40
    assert (tmp_path / "out" / "report.html").is_file()
    assert "has the most influence" in capfd.readouterr().out
