import gc
import tracemalloc

import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError, stream
from screwgauge.study import stream as streaming
from screwgauge.study.stream import times
from support.command import printed_by
from support.engines import Failure
from support.tolerances import LINEAR, OF_A_KILONEWTON, ROUND_TRIP

QUANTITIES = ("joint_position", "generalized_force", "reaction")
MOST = 200.0  # MB, as the guide to scenes says
#: Says the largest memory after a usual part [MB]. Not `ru_maxrss`, which begins with that of the process before.
MEASURED = """
from pathlib import Path
import screwgauge
from screwgauge.study.stream import PART, times
for _ in screwgauge.stream(screwgauge.load_scene("3ups-upu-s"), times(PART, 1e-3), quantities=["actuator_force"]):
    status = dict(line.split(":") for line in Path("/proc/self/status").read_text().splitlines())
    print(int(status["VmHWM"].split()[0]) / 1e3)
"""


def test_parts_are_the_whole() -> None:
    scene = screwgauge.load_scene("3ups-upu-s")
    whole = screwgauge.run(scene.at(np.arange(50) * 0.01), ("screw",), QUANTITIES)
    parts = list(screwgauge.stream(scene, times(50, 0.01, part=16), quantities=QUANTITIES))
    assert [len(t) for t, _ in parts] == [16, 16, 16, 2]
    np.testing.assert_array_equal(np.concatenate([t for t, _ in parts]), whole.times)
    for name in QUANTITIES:
        joined = np.concatenate([solution.values[name].array for _, solution in parts])
        # the same operations on other lengths of arrays: their sums may be grouped otherwise
        np.testing.assert_allclose(joined, whole.values(name, "screw"), rtol=LINEAR, atol=ROUND_TRIP)


def test_any_engine_streams() -> None:
    scene = screwgauge.load_scene("3ups-upu-s")
    found = {
        engine: [
            solution.values["actuator_force"].array
            for _, solution in stream(
                scene, times(6, 0.1, first=1.0, part=4), engine=engine, quantities=["actuator_force"]
            )
        ]
        for engine in ("screw", "pinocchio", "mujoco")
    }
    mine = np.concatenate(found.pop("screw"))
    for arrays in found.values():
        np.testing.assert_allclose(np.concatenate(arrays), mine, rtol=0, atol=OF_A_KILONEWTON)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda scene: times(0, 1e-3), "0 times"),
        (lambda scene: times(5, -1.0), "-1 s apart"),
        (lambda scene: stream(scene, [np.array([0.0, np.nan])]), "finite"),
        (lambda scene: stream(scene, [np.zeros((2, 2))]), "finite times"),
        (lambda scene: stream(scene, times(2, 1.0), engine="skrew"), "screw"),
        (lambda scene: stream(scene, times(2, 1.0), quantities=["force"]), "force"),
    ],
)
def test_bad_input_is_one_sentence(make, words: str) -> None:
    with pytest.raises(ScrewgaugeError, match=words):
        list(make(screwgauge.load_scene("3ups-upu-s")))


def test_a_part_that_cannot_be_solved_is_named_after_those_that_can(monkeypatch) -> None:
    def solve(scene, engines, quantities):
        if scene.t[0] < 1.0:
            return {"screw": "solved"}, {}
        return {}, {"screw": Failure("screw", "ClosureError: a loop cannot close")}

    monkeypatch.setattr(streaming, "solve", solve)
    parts = stream(screwgauge.load_scene("3ups-upu-s"), times(20, 0.1, part=10))
    assert next(parts)[1] == "solved"
    with pytest.raises(ScrewgaugeError, match=r"t = 1 to 1\.9 s: screw failed: .* cannot close"):
        next(parts)


@pytest.mark.slow
def test_memory_is_that_of_one_part_however_many_there_are() -> None:
    """What stays allocated, counted to the byte from the third part on."""
    parts = screwgauge.stream(screwgauge.load_scene("3ups-upu-s"), times(8 * 16, 1e-3, part=16))
    for _ in range(2):  # what is made once and kept
        next(parts)
    tracemalloc.start()
    try:
        allocated, size = [], 0
        for _, solution in parts:
            size = sum(values.array.nbytes for values in solution.values.values())
            gc.collect()
            allocated.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert len(allocated) == 6
    assert allocated[-1] - allocated[0] < size  # that of one part; five have followed


@pytest.mark.slow
def test_a_usual_part_takes_what_the_guide_says() -> None:
    said = printed_by(MEASURED)
    assert float(said) < MOST


def test_a_forward_scene_is_not_streamed():
    with pytest.raises(ScrewgaugeError, match="integrated, not streamed"):
        next(iter(screwgauge.stream(screwgauge.load_scene("a01-pendulum"), [np.array([0.0, 0.1])])))


def test_a_singular_pose_is_met_in_a_stream_too(write):
    # passes b = 0.3568 rad between two parts
    text = 'mechanism = "3ups-upu-s"\n[motion.a]\noffset = 0\n[motion.b]\npolynomial = [0, 0.05]\n[time]\ntimes = [0]\n'
    scene = screwgauge.load_scene(write("through.toml", text))
    found = screwgauge.stream(scene, [np.array([0.0, 7.0]), np.array([7.2, 8.0])], quantities=["joint_velocity"])
    assert next(found)[0][-1] == 7.0
    with pytest.raises(ScrewgaugeError, match=r"leg1\.wrist"):
        next(found)
