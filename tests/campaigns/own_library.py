"""Dynamics of imported machines, beside those that the library of the file's own format has of the file itself."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import mujoco
import numpy as np
import pinocchio
from numpy.typing import NDArray

from screwgauge.diagnosis.libraries import ASKED, ROUNDING, joint_states
from screwgauge.diagnosis.machine.pair import Partner
from screwgauge.diagnosis.motion import FITS, Partners, follow
from screwgauge.diagnosis.shares import Torques, with_gravity
from screwgauge.models.check import expected_reading
from screwgauge.models.importing.model import Imported
from screwgauge.models.kinematics import ReadingTree, tree_of
from screwgauge.models.readings.loops import loops_for, with_loops
from screwgauge.models.readings.read import libraries_of, read_source
from screwgauge.models.readings.reading import FREEDOMS, Reading
from screwgauge.models.readings.source import Source, prepare
from screwgauge.reference.left_out import BorneWeight, TurnResistance, damper_law
from screwgauge.reference.rotations import Array, cross
from screwgauge.witness.dynamics import inverse_dynamics, passive_parts
from screwgauge.witness.tree import TreeStates

#: Format -> the library that files of it are written for.
OWN = {"urdf": "pinocchio", "mjcf": "mujoco", "sdf": "drake", "usd": "newton"}
#: Library of which the project asks nothing else -> the module that asks it.
FURTHER = {"drake": "campaigns.asked_drake", "newton": "campaigns.asked_newton"}
#: Largest scaled difference that is rounding; Newton computes in 32 bits.
LEAVES = {"newton": 3e-6}


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """Inverse dynamics of a library along the velocities of a reading.

    Attributes:
        tau: Shape (n, n_freedom).
        covers: What is in it besides inertia and gravity, as in `raw_queries.Answers`.
        untouched: See `OwnLibrary`.
    """

    tau: Array
    covers: frozenset[str]
    untouched: bool = True


@dataclass(frozen=True, slots=True)
class OwnLibrary:
    """What a library says of a file from which a machine was imported.

    Attributes:
        apart: Largest difference of inverse dynamics at random states, over the largest force of the unit, along
            motions that loops leave.
        states: At how many states both could be compared.
        untouched: The library read the file itself, and nothing that was made of it.
    """

    library: str
    apart: float
    states: int
    untouched: bool

    @property
    def wrong(self) -> bool:
        return not (self.states and self.apart <= LEAVES.get(self.library, ROUNDING))


def own_library(file: Path, imported: Imported, *, floating: bool = False) -> OwnLibrary:
    """Compares an imported machine, with what import names as left out, with its file, at states of the file's tree.

    Raises:
        ScrewgaugeError: The file cannot be read.
        ImportError: Its library is not installed.
        ValueError, LookupError: Its library refuses the file, or has other joints.
    """
    source = prepare(file, floating=floating, meshes=True)
    reading, loops, library = read_source(source, libraries_of(source.form)[0]), loops_for(file), OWN[source.form]
    reading = reading if loops is None else with_loops(reading, loops)
    torques = Torques(with_gravity(reading))
    tree, follower = tree_of(torques.reading), tree_of(with_gravity(_machine(imported, reading)))
    there, velocities, follows = follow(
        tree, torques.states, follower, _partners(tree.reading, follower.reading, imported.names)
    )
    asked = _asked(source, library, tree, torques.states, floating)
    theirs = _whole(asked, tree, torques.states) - _turning(imported, tree, torques.states)
    ours = (np.swapaxes(velocities, 1, 2) @ inverse_dynamics(follower, there)[..., None])[..., 0]
    fits = follows & _same(tree, torques.states, follower, there)
    apart = float(np.abs(torques.project(np.where(fits[:, None], theirs - ours, 0.0))).max(initial=0.0))
    return OwnLibrary(library, apart, int(fits.sum()), asked.untouched)


def _partners(reading: Reading, machine: Reading, names: Mapping[str, str]) -> Partners:
    """Bodies and joints of both by name, with copies of bodies that are cut; import keeps frames of bodies.

    Args:
        names: Names of the machine that are not those of the file.
    """
    bodies, joints = ({names.get(name, name): name for name in each} for each in (reading.bodies, reading.joints))
    copies = ((each.copy_of or name, name) for name, each in machine.bodies.items())
    poses = machine.poses
    return (
        [(bodies[own], name, np.linalg.inv(poses[own]) @ poses[name]) for own, name in copies if own in bodies],
        {name: Partner(other) for other, name in joints.items() if other in machine.joints},
    )


def _same(tree: ReadingTree, states: TreeStates, follower: ReadingTree, there: TreeStates) -> NDArray[np.bool_]:
    """Where coordinates of joints of one name are the same: three hinges in a row reach every pose in two ways."""
    shared = [name for name in tree.places if name in follower.places and FREEDOMS[tree.reading.joints[name].kind] == 1]
    off = [there.q[:, follower.places[name]] - states.q[:, tree.places[name]] for name in shared]
    return np.abs(np.hstack([np.zeros((len(states.q), 1)), *off])).max(axis=1) <= FITS


def _machine(imported: Imported, reading: Reading) -> Reading:
    """The machine as a reading, cut as the file is, with the springs of its scene, and masses that import names."""
    mechanism, gravity = (
        imported.mechanism,
        with_gravity(reading).gravity if imported.gravity is None else imported.gravity,
    )
    assert gravity is not None
    cuts = (expected_reading(mechanism, cut, gravity) for cut in ("minimal", "full"))
    cut = max(cuts, key=lambda each: len({*each.joints} & {*reading.joints}))
    joints, bodies = dict(cut.joints), dict(cut.bodies)
    for spring in imported.springs:
        one = joints[spring.coordinate]
        damping = one.damping + spring.damping
        joints[spring.coordinate] = replace(one, stiffness=spring.stiffness, rest=spring.rest, damping=damping)
    for each in mechanism.left_out:
        if isinstance(each, BorneWeight):
            body = bodies[each.body]
            bodies[each.body] = replace(body, gravcomp=body.gravcomp + each.mass / body.mass)
    for name, body in reading.bodies.items():
        name = imported.names.get(name, name)
        if name in bodies and not (body.mass or bodies[name].mass):
            bodies[name] = replace(bodies[name], inertia=body.inertia)
    return replace(cut, joints=joints, bodies=bodies)


def _turning(imported: Imported, tree: ReadingTree, states: TreeStates) -> Array:
    """Forces of rotors and dampers of balls and free joints, which import leaves out with these numbers."""
    force = np.zeros_like(states.qd)
    left = {each.joint: each for each in imported.mechanism.left_out if isinstance(each, TurnResistance)}
    for name, at in tree.freedoms.items():
        if each := left.get(imported.names.get(name, name)):
            rates, gained = states.qd[:, at], states.qdd[:, at].copy()
            gained[:, 3:] += cross(rates[:, :3], rates[:, 3:]) if rates.shape[1] > 3 else 0.0
            force[:, at] = each.armature * gained + damper_law(each.damping, rates)
    return force


def _whole(asked: Forces, tree: ReadingTree, states: TreeStates) -> Array:
    left = (force for name, force in passive_parts(tree, states).items() if name not in asked.covers)
    return asked.tau + sum(left, np.zeros_like(asked.tau))


def _asked(source: Source, library: str, tree: ReadingTree, states: TreeStates, floating: bool) -> Forces:
    if library in FURTHER:
        forces: Forces = import_module(FURTHER[library]).ask(source.path, tree, states)
        return forces
    module, untouched = import_module(ASKED[library]), True
    question = source.path, tuple(tree.reading.bodies), joint_states(tree, states), floating
    with patch.object(module, "prepare", return_value=source):
        try:
            with patch.object(module, f"load_{library}", return_value=_untouched(source.path, library, floating)):
                answers = module.ask(*question)
        except (ValueError, LookupError):  # a name that the file has twice, or not at all; or a texture is missing
            answers, untouched = module.ask(*question), False
    if any(tree.reading.medium):  # of the drag a description has none
        tau = (answers.mass_matrix @ states.qdd[..., None])[..., 0] + answers.bias
        return Forces(tau, frozenset({"armature"}), untouched)
    return Forces(answers.tau, answers.covers, untouched)


def _untouched(file: Path, library: str, floating: bool) -> Any:
    if library == "mujoco":
        return mujoco.MjModel.from_xml_path(str(file))
    free = (pinocchio.JointModelFreeFlyer(), "root_joint") if floating else ()
    return pinocchio.buildModelFromUrdf(str(file), *free)
