from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from support.engines import IN_DOUBLES
from support.equations import reaction_names
from support.scene import GivenMotion
from support.solve import force_matrix, layout, pose, posed
from support.tolerances import PRINTED, PRINTED_COARSELY, ROUND_TRIP, ROUNDING, SLOPE_OF_ENERGY


def solve(scene, **changes):
    return screwgauge.run(scene, engines=["screw"], **changes)


@pytest.fixture(scope="module")
def known():
    return screwgauge.load_scene("3ups-upu-s").at([0.0, 1.0])


def test_generalized_forces_are_the_known_ones(known):
    Q = solve(known, quantities=["generalized_force"]).values("generalized_force")
    assert np.abs(Q - [[-999.3168, 0.0], [-956.0839, 39.5543]]).max() < PRINTED


def test_minimum_norm_forces_are_the_known_ones(known):
    f = solve(known, quantities=["actuator_force"]).values("actuator_force")
    expected = [[0.0, -721.1948, 0.0, 721.1948], [-23.5163, -681.5408, 22.7680, 705.0812]]
    assert np.abs(f - expected).max() < PRINTED


def test_load_with_the_sign_of_eq_55():
    scene = screwgauge.load_scene("3ups-upu-s-eq55").at([1.0])
    Q = solve(scene, quantities=["generalized_force"]).values("generalized_force")
    assert np.abs(Q - [[948.8419, -47.4219]]).max() < PRINTED


def test_system_has_54_equations_and_56_unknowns(paper):
    lay = layout(paper)
    q = posed(lay, 0.1, 0.05)
    at = pose(lay, q)
    assert force_matrix(at, q, at.S).shape == (1, 54, 56)
    roles = [name.split(".")[-2] for name in reaction_names(paper.joints, ())[0]]
    assert [roles.count(role) for role in ("base", "slide", "wrist", "s")] == [16, 20, 13, 3]


def test_equations_and_projection_give_the_same_forces(known):
    results = solve(known)
    worst = results.judge.set_index(["residual", "unit"])["max_scaled"]
    assert worst["newton_euler"].max() < ROUNDING
    assert worst["power_balance"].max() < ROUNDING


def test_forces_derive_from_the_potential_at_rest(paper):
    """Central differences of the height."""
    scene = screwgauge.load_scene("3ups-upu-s").at([1.0])
    lay = layout(paper)
    y = np.array([0.21, 0.07])

    def potential(y):
        at = pose(lay, posed(lay, *y))
        com = [at.p[0, i + 1] + at.R[0, i + 1] @ body.com for i, body in enumerate(paper.bodies)]
        return 9.81 * sum(body.mass * r[2] for body, r in zip(paper.bodies, com, strict=True))

    zero = np.zeros((1, 2))
    still = replace(scene, task=GivenMotion(np.zeros(1), y[None].copy(), zero, zero.copy())).under(loads=())
    Q = solve(still, quantities=["generalized_force"]).values("generalized_force")[0]
    h = 1e-5
    expected = [(potential(y + h * e) - potential(y - h * e)) / (2 * h) for e in np.eye(2)]
    assert np.abs(Q - expected).max() < 0.1 * SLOPE_OF_ENERGY


@pytest.mark.slow
def test_actuators_deliver_the_power_of_the_generalized_forces():
    scene = screwgauge.load_scene("3ups-upu-s-fast")
    scene = scene.at(np.linspace(0.0, 0.2, 2001))
    results = solve(scene, quantities=["joint_velocity", "generalized_force", "actuator_force"])
    power = np.sum(results.values("generalized_force") * scene.motion.yd, axis=1)
    driven = scene.mechanism.actuated_columns
    of_actuators = np.sum(results.values("actuator_force") * results.values("joint_velocity")[:, driven], axis=1)
    assert np.abs(power - of_actuators).max() < ROUND_TRIP * np.abs(power).max()


@pytest.mark.slow
def test_spherical_axial_gives_the_known_forces():
    scene = replace(screwgauge.load_scene("3ups-upu-s").at([1.0]), rule="spherical_axial")
    for engine in IN_DOUBLES:
        results = screwgauge.run(scene, engines=[engine], quantities=["actuator_force"])
        assert results.values("actuator_force")[0] == pytest.approx(
            [-619.6, -9437.5, -580.8, -7758.9], abs=PRINTED_COARSELY
        )


@pytest.mark.slow
@pytest.mark.parametrize("engine", IN_DOUBLES)
def test_spherical_axial_says_where_it_is_singular(engine):
    times = np.pi * np.arange(4)
    scene = replace(screwgauge.load_scene("3ups-upu-s").at([*times, 1.0]), rule="spherical_axial")
    results = screwgauge.run(scene, engines=[engine], quantities=["actuator_force"])
    forces = results.values("actuator_force")
    assert np.isnan(forces[:4]).all()
    assert np.isfinite(forces[4]).all()
    (note,) = results.solutions[engine].notes
    assert "spherical_axial is singular at 4" in note
    assert "t = 0, 3.14159" in note
