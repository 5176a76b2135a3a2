import numpy as np
import pytest

import screwgauge
from support.engines import solve
from support.geometry import within_half_turn
from support.near import BASE, UPU
from support.questions import SCENE, scene_at
from support.scene import check_scene
from support.solve import closed_form_positions, layout

pytestmark = pytest.mark.slow

#: Sizes of steps, and the least distance from the lines on which leg 3 locks (BASE) and leg 1 lets go (UPU) [rad].
STEPS, LEAST = (1e-6, 0.3), 1e-6
#: Angles of joints, to which locks leave ten digits, against other assemblies.
ALIKE = 1e-8


def walk(n, seed):
    rng, y = np.random.default_rng(seed), [np.zeros(2)]
    while len(y) < n:
        centre = np.array([(BASE, 0.0), (-BASE, 0.0), (0.0, BASE), (rng.uniform(-0.5, 0.5), UPU)][rng.integers(4)])
        goal = centre + 10.0 ** rng.uniform(-4, -1) * rng.normal(size=2)
        margin = 10.0 ** rng.uniform(-6, -2)
        goal[1] = np.clip(goal[1], BASE + margin, UPU - margin)
        pieces = 2 + int(np.abs(goal - y[-1]).max() / STEPS[1])
        y += [*np.linspace(y[-1], goal, pieces)[1:]]
        for _ in range(50):
            new = y[-1] + 10.0 ** rng.uniform(*np.log10(STEPS)) * rng.normal(size=2)
            if np.abs(new - centre).max() < 0.35 and BASE + LEAST < new[1] < UPU - LEAST:
                y.append(new)
    return np.array(y[:n])


@pytest.mark.slow
def test_random_steps_about_locks_change_no_assembly_and_are_not_refused():
    scene = scene_at(screwgauge.load_scene(SCENE), walk(150, seed=1))
    check_scene(scene)
    right = closed_form_positions(layout(scene.mechanism), scene.motion.y)
    answers, failures = solve(scene, ("screw", "pinocchio", "mujoco"), ("joint_position",))
    assert not failures
    for engine, solution in answers.items():
        assert np.abs(within_half_turn(solution.assembly - right))[:, :12].max() < ALIKE, engine
