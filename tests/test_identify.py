"""Identification: what no motion tells, estimates from another engine's forces, and numbers written back."""

from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.command import main
from support.identify import (
    FORCE,
    Recorded,
    drawn,
    forces,
    identify,
    largest,
    log,
    moved,
    regressor,
    structure,
    unknown,
)
from support.mechanism import load_mechanism

NOISE = 1e-3
#: Machine -> moments and resistances, and how many combinations of them forces depend on.
RANKS = {"five-bar": (46, 11), "3ups-upu-s": (102, 63), "delta": (109, 40), "stewart": (148, 100)}


def scene_of(name, count=201):
    scene = screwgauge.load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], count))


def thick(scene):
    more = {f"joints.{joint.name}.rotor": "x + 0.5" for joint in scene.mechanism.actuators if len(joint.home) == 1}
    return scene.with_({f"bodies.*.inertia.{key}": "x + 0.05" for key in ("xx", "yy", "zz")} | more)


@pytest.fixture(scope="module")
def five_bar():
    return scene_of("five-bar")


@pytest.mark.parametrize("name", ["five-bar", *(pytest.param(n, marks=pytest.mark.thorough) for n in [*RANKS][1:])])
def test_directions_that_no_motion_tells_are_all_there_and_change_no_force_of_another_engine(name):
    scene = thick(scene_of(name, 21))
    known = regressor(scene)
    found = structure(known)
    assert (found.count, found.rank) == RANKS[name]
    assert found.gap[0] > 1e6 * found.gap[1]
    vectors = np.array([[one.entries.get(key, 0.0) for key in known.names] for one in found.directions])
    assert np.linalg.matrix_rank(vectors / np.linalg.norm(vectors, axis=1)[:, None]) == found.count - found.rank
    nominal = forces(scene)[1]
    for vector in vectors:
        step = 1e-5 * vector / np.abs(vector).max()  # small: a load at a centre of mass is not linear in moments
        assert np.abs(forces(moved(scene, known, step))[1] - nominal).max() < 1e-11 * largest(nominal)


def test_rank_is_that_of_another_engine(five_bar):
    scene = thick(screwgauge.exciting(five_bar))
    known = regressor(scene)
    nominal = forces(scene)[1]
    columns = [(forces(moved(scene, known, step))[1] - nominal).ravel() for step in 1e-3 * np.eye(len(known.names))]
    values = np.linalg.svd(np.array(columns), compute_uv=False)
    assert (values > 1e-9 * values[0]).sum() == RANKS["five-bar"][1]


def trials(name, count):
    rng, scene = np.random.default_rng(0), scene_of(name)
    away, errors = [], []
    for _ in range(count):
        names, true = drawn(scene, rng)
        real = scene.with_(dict(zip(names, true.tolist(), strict=True)))
        found = identify(scene, log(real, NOISE, rng))
        away.append(np.abs(found.fit.values - true) / np.where(found.fit.deviations > 0.0, found.fit.deviations, 1.0))
        exact = forces(real)[1]
        fitted = forces(replace(scene, mechanism=found.mechanism))[1]
        errors.append(np.sqrt(np.mean((fitted - exact)[1::2] ** 2)) / largest(exact))
    return np.array(away), np.array(errors)


def test_estimates_are_within_their_own_deviations_of_the_truth():
    away, errors = trials("five-bar", 6)
    assert (away < 3.0).mean() > 0.98
    assert (away < 2.0).mean() > 0.9
    assert errors.max() < 0.5 * NOISE


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["five-bar", "3ups-upu-s"])
def test_deviations_are_as_large_as_they_say(name):
    away, errors = trials(name, 200)
    assert (away < 3.0).mean() >= 0.99
    assert 0.92 <= (away < 2.0).mean() <= 0.98
    assert errors.max() < 0.5 * NOISE


def test_what_the_motion_does_not_tell_data_do_not_tell():
    scene, rng = scene_of("3ups-upu-s", 101), np.random.default_rng(1)
    names, true = drawn(scene, rng)
    before = identify(scene)
    after = identify(scene, log(scene.with_(dict(zip(names, true.tolist(), strict=True))), NOISE, rng))
    unseen = before.expected > 0.9 * before.prior
    assert before.known.any()
    assert unseen.any()
    assert (after.fit.deviations[unseen] > 0.7 * before.prior[unseen]).all()
    assert not after.known[unseen].any()


def test_forces_that_redundant_actuators_exert_against_each_other_change_no_estimate():
    scene, rng = scene_of("3ups-upu-s", 61), np.random.default_rng(2)
    known = regressor(scene)
    data = log(scene, NOISE, rng)
    measured = np.stack([*data.columns.values()], axis=1)
    preload = 50.0 * np.ones_like(measured)
    preload -= known.without_preload(preload)
    assert largest(preload) > 1.0
    more = Recorded(scene.t, dict(zip(data.columns, (measured + preload).T, strict=True)))
    one, other = (identify(scene, x).fit for x in (data, more))
    assert other.values == pytest.approx(one.values, rel=1e-6, abs=1e-9)
    assert other.noise == pytest.approx(one.noise, rel=1e-6)


def test_a_force_that_the_model_does_not_have_is_no_noise(five_bar):
    rng = np.random.default_rng(3)
    data = log(five_bar, NOISE, rng)
    columns = {name: x + 0.1 * largest(x) * np.sin(9.0 * five_bar.t) for name, x in data.columns.items()}
    assert identify(five_bar, data).exit_status == 0
    assert identify(five_bar, Recorded(five_bar.t, columns)).exit_status == 1


def test_a_number_of_a_body_stands_for_all_of_it(five_bar):
    assert len(unknown(five_bar, ["left.rod.mass", "right.friction"])) == 11
    assert {name.split(".")[1] for name in unknown(five_bar, [])} == {"left", "right"}
    assert not any("elbow" in name for name in unknown(five_bar, []))


@pytest.fixture
def table(five_bar, tmp_path):
    data = log(five_bar.with_({"right.rod.mass": 0.46}), 1e-5, np.random.default_rng(4), "mujoco")
    motion = five_bar.motion
    columns = {"t": five_bar.t}
    for i, label in enumerate(five_bar.mechanism.independent):
        columns |= {label: motion.y[:, i], f"{label}d": motion.yd[:, i], f"{label}dd": motion.ydd[:, i]}
    columns |= {f"{name} [N mm]": 1e3 * values for name, values in data.columns.items()}
    path = tmp_path / "log.csv"
    np.savetxt(path, np.stack([*columns.values()], 1), delimiter=",", header=",".join(columns), comments="")
    return path


def test_columns_without_units_are_forces_though_coordinates_have_these_names(five_bar):
    data = log(five_bar, NOISE, np.random.default_rng(5))
    short = Recorded(five_bar.t, {name.partition("/")[2]: values for name, values in data.columns.items()})
    assert identify(five_bar, short).fit.values == pytest.approx(identify(five_bar, data).fit.values)


@pytest.mark.parametrize(("numbers", "rank"), [(["right.friction"], 1), (["left.crank.mass"], 1)])
def test_few_numbers_have_a_rank(numbers, rank, five_bar):
    """A crank in a horizontal plane turns about its hinge alone."""
    found = structure(regressor(five_bar, numbers))
    assert found.rank == rank
    assert len(found.directions) == found.count - found.rank


SMALL = ["--numbers", "right.rod.mass"]


def test_identified_numbers_are_written_as_a_description(table, tmp_path, capsys):
    out = tmp_path / "identified.toml"
    rest = ["--data", str(table), "--fix", str(out), "--out", str(tmp_path / "report"), *SMALL]
    assert main(["identify", "five-bar", *rest]) == 0
    assert "right.rod" in capsys.readouterr().out
    bodies = {body.name: body for body in load_mechanism(out).bodies}
    given = {body.name: body for body in load_mechanism("five-bar").bodies}
    assert bodies["right.rod"].mass == pytest.approx(0.46, abs=1e-3)
    assert bodies["left.rod"].mass == given["left.rod"].mass
    assert {path.name for path in (tmp_path / "report").iterdir()} >= {"numbers.csv", "directions.csv", "report.html"}


def test_identified_numbers_are_written_into_the_model_file(table, tmp_path):
    assert main(["models", "five-bar", "--out", str(tmp_path / "models")]) == 0
    model, out = tmp_path / "models" / "five-bar.urdf", tmp_path / "fixed.urdf"
    rest = ["--data", str(table), "--fix", str(out), "--out", str(tmp_path / "report"), *SMALL]
    assert main(["identify", str(model), *rest]) == 0
    given, fixed = (screwgauge.load_scene(str(path)).mechanism.bodies for path in (model, out))
    masses = {body.name: (before.mass, body.mass) for before, body in zip(given, fixed, strict=True)}
    assert masses.pop("right.rod") == (0.4, pytest.approx(0.46, abs=1e-3))
    assert all(before == after for before, after in masses.values())
    assert len(set(out.read_text().splitlines()) - set(model.read_text().splitlines())) <= 4


REFUSED = {
    "no data to write back": ["--fix", "x.toml"],
    "a fix of another format": ["--data", "LOG", "--fix", "x.urdf"],
    "a noise that is no share": ["--noise", "2"],
    "a prior that is no share": ["--prior", "0"],
    "a number that does not exist": ["--numbers", "nothing.mass"],
    "a number that forces are not linear in": ["--numbers", "left.parent.x"],
    "data that are not there": ["--data", "nothing.csv"],
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused(what, table, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["identify", "five-bar", *(str(table) if x == "LOG" else x for x in REFUSED[what])]) == 2
    assert not (tmp_path / "x.toml").exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.parametrize("columns", [{}, {"nothing": 1.0}, {f"{FORCE}/left [m]": 1.0}])
def test_a_table_without_forces_is_refused(columns, five_bar):
    with pytest.raises(ScrewgaugeError):
        identify(
            five_bar,
            Recorded(five_bar.t, {name: x * five_bar.t for name, x in columns.items()} or {"left": five_bar.t}),
        )
