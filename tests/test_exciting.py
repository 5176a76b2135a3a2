"""Exciting motions: of every mechanism, from home, within limits, with inertia as large as weight, exactly readable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import screwgauge
from screwgauge.judging.coverage import coverage
from screwgauge.reference.errors import DescriptionError
from screwgauge.scene.exciting import exciting
from screwgauge.scene.preflight import check_scene, far_from_home
from screwgauge.scene.read import scene_names
from screwgauge.study.ask import solve

GIVEN = [name for name in scene_names() if not screwgauge.load_scene(name).simulated]
#: One scene for each mechanism.
SCENES = [name for name in GIVEN if name not in ("3ups-upu-s-eq55", "3ups-upu-s-fast")]
#: Share of inertia in the actuator forces: 0.5 to 1.1 is seen, 0.0008 and more in the scenes' own motions.
INERTIA = 0.3
#: Parameters and load points that are tested, of all; the rest lies across what is planar, or turns about one axis.
TESTED = {
    **{"3-rps": (60, 70), "3-rrr": (28, 70), "3-upu": (64, 70), "3ups-upu-s": (93, 93), "3ups-upu-s-offset": (93, 93)},
    **{"arm7": (67, 70), "bennett": (23, 30), "delta": (89, 100), "double-cardan": (20, 30), "five-bar": (16, 40)},
    **{"rccc": (27, 30), "sarrus": (19, 50), "slider-crank": (11, 33), "stewart": (130, 130)},
    "stewart-legs": (130, 130),
}


def covered(scene):
    found, failures = solve(scene, ["screw"], scene.quantities)
    assert not failures
    problem = scene.problem(scene.quantities)
    return coverage(scene.mechanism, problem, found, check_scene(scene), scene.tolerance)


@pytest.mark.parametrize("name", SCENES)
def test_every_mechanism_moves_and_tests_all_that_it_can(name):
    scene = exciting(screwgauge.load_scene(name), 1)
    assert far_from_home(scene) == ()
    found = covered(scene.at(scene.t[::5]))
    assert found.inertia[1] > INERTIA
    assert (len(found.parameters) - len(found.untested), len(found.parameters)) == TESTED[name]
