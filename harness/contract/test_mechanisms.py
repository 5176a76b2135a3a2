"""Answers for built-in and random mechanisms agree with the answers of the solver, and pass the judge."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.contract.fixtures import REFUSALS
from screwgauge.engines.features import FEATURES, refusal
from screwgauge.engines.registry import Engine
from screwgauge.families.draw import families
from screwgauge.problem import GivenMotion
from screwgauge.quantities import FLOAT64, OF_BODIES, OF_JOINTS, OF_MOTION
from screwgauge.reference.mechanism import KINDS
from screwgauge.report.results import Results
from screwgauge.report.verdict import verdict
from screwgauge.scene.scene import Scene

#: Scene -> its distinguishing feature.
MECHANISMS = {
    "arm7": "a tree without loops",
    "slider-crank": "R and P joints, a load",
    "five-bar": "two degrees of freedom, R joints",
    "double-cardan": "U joints",
    "rccc": "C joints",
    "stewart": "F joint to the ground, U, P, S",
    "ruse": "E joint, a cam-like coupling, springs and motors",
    "3-upu": "U, P, U: constraints that depend on each other at first order",
    "delta": "five loops",
    "sarrus": "redundant constraints: some reactions are not unique",
    "bennett": "redundant constraints: no reaction is unique",
    "planetary-gear": "couplings of joints",
    "belt-leg": "couplings of several joints",
    "screw-press": "couplings in a loop",
    "geared-five-bar": "rotors, damping, dry friction, a fixed joint",
    "3ups-upu-s-fast": "fast motion, all inertia, redundant actuators, a load",
}
SEED = 7
#: Quantities that need a rule come last, because their errors may result from errors in other quantities.
FACTS = "motions first, then forces, then reactions: the first that differs is likely to be the cause"
_REFUSED = tuple(error.__name__ for error in REFUSALS)


def other_than(name: str) -> str:
    """Return the name of the engine that serves as the reference for a given engine."""
    return "screw" if name != "screw" else "pinocchio"


@cache
def run_both(name: str, scene: Scene, wanted: tuple[str, ...]) -> Results:
    """Run the engine and the solver on a scene."""
    return screwgauge.run(scene, [other_than(name), name], wanted)


@cache
def built_in(name: str) -> Scene:
    """Return three samples of a built-in scene."""
    scene = screwgauge.load_scene(name)
    return scene.at(np.linspace(scene.t[0], scene.t[-1], 7)[1::2])


def run_engine(entry: Engine, scene: Scene, quantities: Iterable[str], *, strict: bool = False) -> Results:
    """Run an engine on a scene for the quantities that it computes.

    Skip the test if the engine refuses the scene with an error message, and fail it if the engine fails. If strict,
    also fail if the engine refuses a scene for a reason that `refuses` does not name.
    """
    if GivenMotion not in entry.tasks:
        pytest.skip(f"{entry.name} does not accept given motions")
    if why := refusal(entry, scene.mechanism, scene.applied):
        pytest.skip(why)
    results = run_both(entry.name, scene, tuple(q for q in quantities if q not in entry.lacks))
    if failure := results.failures.get(entry.name):
        if failure.reason.startswith(_REFUSED) and not strict:
            pytest.skip(f"{entry.name} refuses it: {failure.reason}")
        pytest.fail(f"{entry.name} failed: {failure.reason}\n{failure.traceback}", pytrace=False)
    return results


@pytest.mark.parametrize("quantity", OF_MOTION)
@pytest.mark.parametrize("name", MECHANISMS)
def test_a_quantity_is_that_of_the_solver(entry: Engine, name: str, quantity: str) -> None:
    if quantity in entry.lacks:
        pytest.skip(f"{entry.name} lacks {quantity}: {entry.lacks[quantity]}")
    results = run_engine(entry, built_in(name), OF_MOTION)
    if why := results.solutions[entry.name].lacks.get(quantity):
        pytest.skip(f"{entry.name} lacks {quantity} for {name}: {why}")
    rows = results.pairs[results.pairs["quantity"] == quantity]
    if not len(rows):
        pytest.skip(f"{name} has no component of {quantity} with a unique value")
    bad = rows[~rows["ok"].astype(bool)]
    said = [
        f"{row['worst_component']} by {row['max_abs']:.3g} {row['unit']} ({row['max_scaled']:.2g} scaled, tolerance "
        f"{row['tolerance']:.2g}) at t = {row['worst_t']} s {row['reason'] or ''}"
        for row in bad.to_dict("records")
    ]
    assert not said, f"{quantity} of {name} ({MECHANISMS[name]}) differs, first in {said[0]}. Look at {FACTS}"


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_judge_faults_nothing(entry: Engine, name: str) -> None:
    """The engine's own numbers satisfy the equations of motion, loop closure and power balance."""
    results = run_engine(entry, built_in(name), OF_MOTION)
    if not len(results.judge[results.judge["engine"] == entry.name]):
        pytest.skip(f"{entry.name} returns too few quantities for {name} to be judged")
    faults = results.faults[results.faults["engine"] == entry.name]
    rows = faults.to_dict("records")
    said = [f"{row['residual']} {row['max_scaled']:.2g} at {row['worst_component']}" for row in rows]
    assert not said, f"numbers of {name} contradict each other: {'; '.join(said)}"


#: Description of a body connected to ground by one joint, without actuators; the kind, axes and other entries vary.
ALONE = """name = "alone"
[independent]
{independent}
[bodies.b]
mass = 2
com = [0.1, -0.2, 0.05]
inertia = {{ xx = 0.03, yy = 0.04, zz = 0.05, xy = 0.002 }}
[joints.j]
kind = "{kind}"
parent = "ground"
child = "b"
parent_frame = {{ position = [0.1, 0.2, 0.3] }}
child_frame = {{ position = [0, 0.1, 0] }}
{entries}
"""
MOVING = """mechanism = "alone.toml"
time.times = [0.1, 0.4]
gravity = [1, -2, -9]
[motion]
{motion}
"""
SPRING = '[[springs]]\ncoordinate = "j"\nstiffness = 40\nrest = 0.2\ndamping = 3\n'
RESISTING = "rotor = 0.1\ndamping = 0.5\nfriction = 0.2"
PUSH = '[[loads]]\non = "b"\nby = "environment"\npoint = [0.2, -0.1, 0.3]\n'
#: Feature -> scene entries that need it.
ACTING = {
    "springs": SPRING,
    "courses": f"{PUSH}force = [1, {{ polynomial = [2, 3] }}, {{ harmonics = [[4, 1, 2]] }}]\n",
    "axes": f'{PUSH}axes = "body"\nforce = [3, -2, 1]\ntorque = [0.2, 0.5, -0.3]\n',
}
#: Quantities compared for a body on one joint.
OF_ONE = (*OF_JOINTS, *OF_BODIES, "generalized_force")


def on_one_joint(feature: str, folder: Path) -> Scene:
    """Build a scene of a body on one joint of a given kind, or on a revolute joint with a given feature."""
    if feature == "couplings":
        return built_in("planetary-gear")
    kind = feature if feature in KINDS else "R"
    n = len(KINDS[kind])
    names = ["j"] if n == 1 else [f"j.{part}" for part in ("x", "y", "z", "q1", "q2", "q3")[:n]]
    if kind != "F" and n > 1:
        names = [f"j.q{i + 1}" for i in range(n)]
    independent = "\n".join(f'y{i} = "{name}"' for i, name in enumerate(names))
    motion = "\n".join(f"y{i} = {{ harmonics = [[{3 + i}, 0, 0.{2 + i}]] }}" for i in range(n))
    axes = np.eye(3)[: {"U": 2, "S": 3, "F": 3}.get(kind, 1)].tolist()
    entries = f"axes = {axes}\n{RESISTING if feature == 'resistance' else ''}"
    (folder / "alone.toml").write_text(ALONE.format(kind=kind, independent=independent, entries=entries), "utf-8")
    text = MOVING.format(motion=motion) + ACTING.get(feature, "")
    (folder / "scene.toml").write_text(text, "utf-8")
    return screwgauge.load_scene(folder / "scene.toml")


@pytest.mark.parametrize("feature", [name for name in FEATURES if name != "fixed"])
def test_a_feature_is_taken_or_declared(entry: Engine, feature: str, tmp_path: Path) -> None:
    """The engine supports joint kinds, couplings, resistance, springs and loads, or names them in `refuses`."""
    results = run_engine(entry, on_one_joint(feature, tmp_path), OF_ONE, strict=True)
    assert results.exit_status == 0, verdict(results).text


@pytest.mark.parametrize("family", families())
def test_a_random_mechanism_agrees(entry: Engine, family: str) -> None:
    """The engine agrees for a random mechanism; call ``screwgauge.random(7, FAMILY)`` to reproduce a failure."""
    scene = screwgauge.random(SEED, family)
    results = run_engine(entry, scene, scene.quantities)
    if entry.precision != FLOAT64.name and results.outcome == "undecided":
        pytest.skip(f"the rounding of {entry.precision} leaves the comparison undecided")
    assert results.exit_status == 0, verdict(results).text
