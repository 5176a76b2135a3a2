from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import arb, ctx, fmpq

import screwgauge
from support.data import data
from support.engines import Clock
from support.mechanism import load_mechanism, mechanism_tables
from support.scene import GivenMotion
from support.solve import layout, posed, positions
from support.tolerances import RADIUS
from support.truth import Certifier, Linkage, NotCertified, Sampler, drive, exact, forces, read_terms


def balls(scene, bits):
    mechanism = load_mechanism(scene.mechanism_file)
    start = positions(layout(mechanism), scene.motion.y, scene.t)[0].tolist()
    with ctx.workprec(bits):
        linkage = Linkage(mechanism, mechanism_tables(scene.mechanism_file))
        sampler = Sampler(linkage, scene.problem(["reaction"]), "f", Clock())
        terms = read_terms(scene.wording().motion, list(mechanism.independent))
        return sampler.sample(drive(terms, float(scene.t[0])), start)


@pytest.mark.parametrize("name", ["3ups-upu-s-fast", "3ups-upu-s-offset"])
def test_balls_hold_what_more_digits_give(name):
    scene = screwgauge.load_scene(name).at([0.37])
    coarse, fine = balls(scene, 128), balls(scene, 400)
    for quantity, values in fine.items():
        for few, many in zip(coarse[quantity], values, strict=True):
            assert few.contains(many), f"{quantity}: {few} does not hold {many}"
            assert many.rad() < few.rad() or few.is_exact()


@pytest.mark.parametrize("text", ["0.1", "1e-3", "-2.50", "1_000.5", "+.7", "3."])
def test_decimals_are_exact_rationals(text):
    value = Fraction(text.replace("_", ""))
    with ctx.workprec(192):
        assert abs(exact.number(text) * value.denominator - value.numerator) < arb(2) ** -180
        assert exact.number(text).contains(fmpq(value.numerator, value.denominator))


def test_expressions_and_integers_are_enclosed():
    with ctx.workprec(192):
        assert abs(exact.number("3*sqrt(3)/10") ** 2 - arb(27) / 100) < arb(2) ** -180
        assert abs(exact.number("atan(1/3)").tan() - arb(1) / 3) < arb(2) ** -180
        assert exact.number("-2**3") == -8
        assert exact.number(7) == 7
        assert exact.number(0.1) != exact.number("0.1")  # a double is meant as it is


def test_decimals_of_a_matrix_are_made_a_rotation():
    rows = [["0.6", "0.8", 0], ["-0.8000000000001", "0.6", 0], [0, 0, 1]]
    with ctx.workprec(192):
        R = exact.rotation_matrix({"matrix": rows})
        gap = R * R.transpose() - exact.identity(3)
        assert max(float(x.abs_upper()) for x in gap.entries()) < 1e-54


def test_motion_replaced_by_hand_is_taken_as_doubles():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.3, 0.6])
    assert scene.wording().motion is not None
    assert scene.wording().gravity is not None
    assert scene.wording().loads is not None
    y = scene.motion.y.copy()
    y[1, 0] = np.nextafter(y[1, 0], 1.0)
    changed = replace(scene, task=GivenMotion(scene.t, y, scene.motion.yd, scene.motion.ydd))
    assert changed.wording().motion is None
    results = screwgauge.run(changed, engines=["truth"], quantities=["joint_position", "joint_velocity"])
    assert (results.values("joint_position")[:, -3:-1] == y).all()
    assert (results.values("joint_velocity")[:, -3] == scene.motion.yd[:, 0]).all()


def test_gravity_and_loads_replaced_by_hand_are_taken_as_doubles():
    scene = screwgauge.load_scene("3ups-upu-s").at([0.3])
    load = replace(scene.applied.loads[0], force=scene.applied.loads[0].force * 2)
    changed = scene.under(gravity=np.array([0.0, 1.0, -9.0]), loads=(load,))
    assert changed.wording().gravity is None
    assert changed.wording().loads is None
    assert screwgauge.run(changed, engines=["screw", "truth"]).ok


def test_csv_motion_has_a_truth(write):
    scene = screwgauge.load_scene("3ups-upu-s").at([0.0, 0.25])
    lines = ["t,a,ad,add,b,bd,bdd"]
    for row in zip(scene.t, scene.motion.y, scene.motion.yd, scene.motion.ydd, strict=True):
        t, y, yd, ydd = row
        lines.append(",".join(repr(float(x)) for x in (t, y[0], yd[0], ydd[0], y[1], yd[1], ydd[1])))
    write("motion.csv", "\n".join(lines) + "\n")
    sampled = screwgauge.load_scene(write("s.toml", 'mechanism = "3ups-upu-s"\n[motion]\ncsv = "motion.csv"\n'))
    assert sampled.wording().motion is None
    results = screwgauge.run(sampled, engines=["screw", "truth"])
    assert results.ok
    assert results.radius("reaction").max() < RADIUS


def test_routes_that_disagree_are_an_error(monkeypatch):
    right = forces.required_wrenches

    def wrong(linkage, now, gravity, loads):
        b = right(linkage, now, gravity, loads)
        return [b[0] + arb(2) ** -100, *b[1:]]  # 1e-30 N

    monkeypatch.setattr("screwgauge.truth.samples.required_wrenches", wrong)
    results = screwgauge.run(screwgauge.load_scene("3ups-upu-s-fast").at([0.1]), engines=["screw", "truth"])
    assert results.exit_status == 3
    assert "RoutesDisagree: t = 0.1 s" in results.failures["truth"].reason


def test_singular_pose_is_not_certified():
    mechanism = load_mechanism("3ups-upu-s")
    y = [0.1, np.arctan2(0.3 * 3**0.5, 0.5) - np.arccos((0.25 + 0.27) ** 0.5 / 0.8)]
    start = posed(layout(mechanism), *y)[0].tolist()
    with ctx.workprec(192):
        certifier = Certifier(Linkage(mechanism, mechanism_tables("3ups-upu-s")))
        b = (exact.number("3*sqrt(3)/5")).atan() - (arb(13) / 16).sqrt().acos()
        with pytest.raises(NotCertified, match="singular"):
            certifier.solve([arb(0.1), b], start)


def test_poor_guess_ends_in_a_proof_or_a_refusal():
    mechanism = load_mechanism("3ups-upu-s")
    start = posed(layout(mechanism), 0.1, 0.05)[0]
    with ctx.workprec(192):
        certifier = Certifier(Linkage(mechanism, mechanism_tables("3ups-upu-s")))
        y = [arb("0.1"), arb("0.05")]
        near, _, _ = certifier.solve(y, start.tolist())
        again, _, _ = certifier.solve(y, (start + 1e-3).tolist())
        assert all(a.overlaps(b) for a, b in zip(near, again, strict=True))
        with pytest.raises(NotCertified):
            certifier.solve(y, (start + 1.0).tolist())


def test_loops_that_close_only_to_rounding_are_refused_in_one_sentence(write):
    text = data("crank-and-bar.toml")
    write("bar.toml", text)
    scene = "mechanism = 'bar.toml'\nmotion = { a = { polynomial = [0, 1] } }\ntime = { times = [0.1] }\n"
    results = screwgauge.run(screwgauge.load_scene(write("s.toml", scene)), engines=["truth"])
    assert results.exit_status == 3
    reason = results.failures["truth"].reason
    assert reason.startswith("NotCertified: t = 0.1 s, a = 0.1: no sample")
    assert " at least 1e-13 " in reason


def test_missing_python_flint_is_one_sentence(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "flint", None)
    monkeypatch.delitem(sys.modules, "screwgauge.truth.engine", raising=False)
    results = screwgauge.run(screwgauge.load_scene("3ups-upu-s").at([0.0]), engines=["truth"])
    assert results.exit_status == 3
    reason = results.failures["truth"].reason
    assert reason.startswith("not installed")
    assert reason.endswith("pip install 'screwgauge[truth]'")
