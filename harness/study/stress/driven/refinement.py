"""Proximal refinement of MuJoCo's soft loops: accelerations of the loaded default scene, pass by pass."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter

from screwgauge.study.bench.contestant import count
from screwgauge.study.stress.case import Case, Finding, Rung

SOFT = "softness of the loops, ((1 - d) / d)^(passes + 1), of which nothing is said"
PASSES = (0, 1, 2, 4)


def refinement() -> Case:
    """The last constraint force is applied from outside, and the accelerations are solved for again."""
    return Case(
        name="refinement",
        title="MuJoCo's softness refined away",
        axis="softness 1 - d of solimp [1]",
        about=(
            "Accelerations of the loaded default scene from its actuator forces, at three instants. MuJoCo is solved "
            "once (0 passes), then again with the last constraint force applied from outside, pass by pass. The error "
            "goes as ((1 - d) / d)^(passes + 1): straight lines of slope 1, 2, 3 ... down to rounding. MuJoCo's "
            "default is 1 - d = 0.1 for closed loops, its least 1e-4."
        ),
        drawn="joint_acceleration",
        low=1e-4,
        high=0.5,
        full=(1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1),
        quick=(1e-4, 5e-4, 2e-3, 1e-2, 3e-2, 1e-1),
        rung=lambda softness, quick: Rung(softness, lambda: climb(softness)),
    )


def climb(softness: float) -> Iterator[Finding]:
    """All engines at one softness 1 - d, which only MuJoCo has."""
    from screwgauge.study.stress.driven.loaded import loaded, screw

    own = screw(loaded())
    yield own
    for passes in PASSES:
        yield mujoco(1.0 - softness, passes, own.condition)


def mujoco(d: float, passes: int, condition: float) -> Finding:
    """MuJoCo at an impedance d after some passes."""
    from screwgauge.models.loops import loops_of
    from screwgauge.study.bench.contestants_mujoco import forward_call, soften, with_equality
    from screwgauge.study.bench.projection import given
    from screwgauge.study.stress.driven.loaded import finding, loaded
    from screwgauge.study.stress.driven.mujoco_steps import load_tree

    case = loaded()
    tree = load_tree(case.scene)
    start = given(case, tree, loops_of(case.scene.mechanism, "minimal"))
    soften(tree, d)
    call = forward_call(*with_equality(start), start, passes)
    clock = perf_counter()
    found = call()
    seconds = perf_counter() - clock
    label = f"mujoco {count(passes, 'pass')}"
    return finding(case, label, tree.coordinates, found, seconds=seconds, condition=condition, cause=SOFT)
