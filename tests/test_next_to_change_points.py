import numpy as np
import pytest
import tomli_w

import screwgauge
from support.geometry import rotation
from support.singular import four_bar

#: Crank and coupler of parallelograms [m].
BARS = [(0.3, 0.5), (0.2, 0.7), (0.3, 0.3), (0.35, 0.62)]
START = np.pi - 0.8
#: Along general axes, and far from the origin.
PLACES = [
    None,
    *(
        (rotation(np.array(axis) / np.linalg.norm(axis), np.array(2.0)), at)
        for axis, at in (([1.0, 2.0, 2.0], [0.6, -0.4, 1.4]), ([3.0, -1.0, 0.5], [0.3, -0.2, 0.7]))
    ),
]


def parallelogram(crank, coupler, place):
    table = {"name": "parallelogram", **four_bar(crank, coupler, crank, coupler, START)}
    for joint in table["joints"].values():
        if place is not None and joint["parent"] == "ground":
            R, p = place
            at = R @ joint["parent_frame"]["position"] + p
            joint["parent_frame"] = {"position": at.tolist(), "rotation": {"matrix": R.tolist()}}
    return table


@pytest.mark.sampled(4)  # each engine, and each place
@pytest.mark.parametrize("engine", ["screw", "pinocchio", "mujoco"])
@pytest.mark.parametrize("place", range(len(PLACES)))
def test_a_parallelogram_is_followed_to_a_hundred_millionth_of_a_radian_before_its_bars_are_one_line(
    engine, place, write
):
    wrong = []
    for i, bars in enumerate(BARS):
        write(f"m{i}.toml", tomli_w.dumps(parallelogram(*bars, PLACES[place])))
        for distance in (1e-6, 1e-7, 3e-8, 1e-8):
            end = np.pi - distance
            motion = {"mechanism": f"m{i}.toml", "motion": {"a": {"polynomial": [START, end - START]}}}
            scene = write("s.toml", tomli_w.dumps(motion | {"time": {"times": np.linspace(0.0, 1.0, 7).tolist()}}))
            results = screwgauge.run(screwgauge.load_scene(scene), [engine], ["joint_position"])
            if results.failures:
                wrong.append((bars, distance, results.failures[engine].reason))
                continue
            q = results.values("joint_position", engine)
            a = q[:, :1]
            off = np.abs(q - np.hstack([a, -a, a, a])).max()
            admitted = results.solutions[engine].errors["joint_position"].largest * np.abs(q).max()
            if not off <= admitted < 1e-4:
                wrong.append((bars, distance, off, admitted))
    assert wrong == []
