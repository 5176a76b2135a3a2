"""Stiff springs in the legs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from screwgauge import ScrewgaugeError
from screwgauge.study.bench.stiff import RADAU, accelerations, admit_tolerance, explicit_method, leg_springs, motion
from support.engines import Method
from support.mechanism import load_mechanism
from support.questions import SCREW, Question, findings, loaded_scene, push, tree_coordinates
from support.scene import Integration
from support.stress import DEGRADED, GOOD, OK, REFUSED, Finding

pytestmark = pytest.mark.slow

SPRUNG = load_mechanism("3ups-upu-s")


def right(stiffness: float, folder: Path) -> tuple[Question, float]:
    return motion(leg_springs(SPRUNG, stiffness), folder)


def integrated(stiffness: float, integration: Integration, folder: Path) -> list[Finding]:
    return list(findings(admit_tolerance(right(stiffness, folder)[0], integration, SCREW)))


@pytest.mark.slow
def test_the_fastest_eigenvalue_is_a_hundred_thousand_at_the_hardest_springs(tmp_path: Path) -> None:
    stiffness = np.array([1e6, 1e10])
    fastest = [right(k, tmp_path)[1] for k in stiffness.tolist()]
    assert fastest[1] == pytest.approx(1e5, rel=0.05)
    assert np.diff(np.log(fastest)) / np.diff(np.log(stiffness)) == pytest.approx(0.5, abs=0.01)


@pytest.mark.slow
def test_the_reference_and_an_explicit_method_agree(tmp_path: Path) -> None:
    # they share nothing but the accelerations; DOP853 at 1e-9 leaves some 1e-10
    for finding in integrated(1e4, Integration("DOP853", 1e-9, 1e-11), tmp_path):
        assert finding.error < GOOD, finding


@pytest.mark.slow
def test_a_looser_tolerance_is_admitted_to_lose_digits(tmp_path: Path) -> None:
    for finding in integrated(1e4, RADAU, tmp_path):
        assert finding.verdict == DEGRADED
        assert "the tolerance, 1e-05, admits" in finding.reason


@pytest.mark.slow
def test_an_explicit_method_is_refused_with_its_stable_step(tmp_path: Path) -> None:
    position, energy = findings(explicit_method(*right(1e10, tmp_path)))
    assert position.verdict == energy.verdict == REFUSED
    assert "9.9e+04 1/s limits its step to 6.1e-05 s" in position.reason


@pytest.mark.slow
def test_the_error_of_accelerations_grows_with_stiffness_as_is_admitted(tmp_path: Path) -> None:
    stiffness = np.array([1e7, 1e8, 1e9, 1e10])
    found = {k: [one for q in accelerations(k, tmp_path) for one in findings(q)] for k in (1e2, *stiffness.tolist())}
    assert {finding.verdict for finding in found[1e2]} == {OK}
    for i, engine in enumerate(("screw", "pinocchio", "mujoco")):
        rows = [found[k][i] for k in stiffness.tolist()]
        assert {row.engine for row in rows} == {engine}
        slope = np.polyfit(np.log(stiffness), np.log([row.error for row in rows]), 1)[0]
        assert slope == pytest.approx(1.0, abs=0.3)  # rounding errors scatter
        assert all(row.verdict in (OK, DEGRADED) for row in rows)
    admitted = [found[k][0].tolerance for k in stiffness.tolist()]
    assert np.polyfit(np.log(stiffness), np.log(admitted), 1)[0] == pytest.approx(1.0, abs=1e-3)  # dampers: root


def test_engines_agree_on_springs_beside_given_forces_and_take_no_other_ones(tmp_path: Path) -> None:
    posed = loaded_scene(tmp_path)
    mechanism, names = posed.scene.mechanism, tree_coordinates(SPRUNG)
    springs, found = leg_springs(mechanism, 1e4), []
    for method in (SCREW, Method("pinocchio"), Method("mujoco", {"solimp": 0.9999, "passes": 6})):
        question = push(posed, method)
        sprung = replace(question.problem, applied=replace(question.problem.applied, springs=springs))
        model = method.load(question.files[method.engine])
        found.append(model.solve(sprung).values["joint_acceleration"].pick(names).array)
        if method is not SCREW:
            with pytest.raises(ScrewgaugeError, match="only gravity and springs"):
                model.solve(replace(sprung, applied=posed.scene.applied))
            plain = model.solve(question.problem).values["joint_acceleration"].pick(names).array
            assert np.abs(plain - found[0]).max() > 1e-3 * np.abs(found[0]).max()  # springs matter, and only when asked
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=0, atol=1e-12 * np.abs(found[0]).max())
