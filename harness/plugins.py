"""Everything that an engine of another package imports: question, description, answer, and functions for common steps.

``from screwgauge.plugins import ...`` is the only import of this package that an engine needs. The names below and
their meanings do not change within a major version; the modules that define them may move in any version.

Conventions. SI units; angles in rad. The first axis of arrays is the sample. Bodies are in the order of the
description, after the ground at index 0: orientations R have shape (n, n_body + 1, 3, 3), origins p (n, n_body + 1, 3).
Vectors are in world axes unless stated otherwise. Wrenches (..., 6) are force, then moment about a named point. Twists
and accelerations of bodies (..., 6) consist of an angular part, then the velocity or acceleration of the body's origin,
as in `OpenTree`. `Array` is the type of all these arrays.

**Entry.** `Engine` describes an engine to the registry: ``module:function`` that loads it, its tasks, its package. That
function takes `ModelFiles` and returns a model with ``solve(problem, progress)``, an `EngineModel`. A `Progress` takes
the share of the work that is done, 0 to 1; `quiet` ignores it. An engine that can compute in float32 lists it,
``precisions=("float64", "float32")``, and its function takes ``precision="float32"`` if a user requests
``NAME@float32``; its answers are always arrays of float64.

**Question.** A `Problem` has a task, the acting forces, the names of the requested quantities, the rule for redundant
actuators, and named points (`Point`). Tasks are `GivenMotion` (inverse dynamics), `InitialValue` (simulation, by an
`Integration`) and `States` (given states of an open tree). `Applied` holds gravity (`GRAVITY` by default), loads
(`Load`), springs (`JointSpring`, `PointSpring`) and motors (`Motor`). A `Load` may vary over time as a `Course` or
`Samples`, see `Load.at`, and may turn with its body (`axes`). `GIVEN` names the default quantities of a given motion,
`OF_MOTION` all available quantities.

**Description.** `load_mechanism` reads a `Mechanism` of `Body`, `Joint` (with a `Frame` on each side) and couplings
(`Coupling`, a `PolynomialSum`; a coupling with `fixing` locks a fixed joint). `GROUND` is the name of the ground.
`resistances` lists rotors, dampers and dry friction as `Resistance`.

**Answer.** A `Solution` has `Values` by quantity, and may have an `Error` for each quantity. `names` returns the
ordered components and units of each quantity, of type `Names`. `stages` returns the last stage of the computation that
the requested quantities require: ``q``, ``v``, ``a`` or ``f``. A `Clock` measures the time of each stage. `answer`
builds the solution from a function that solves each part of a motion (`SolvedPart`), with condition numbers in a
`Trust`.

**Bodies and joints.** `body_poses` computes the poses of bodies from joint coordinates, such as those of the home pose;
`absolute_poses` computes them from positions and quaternions. `read_joints` reads joint coordinates from poses,
`follow_joints` counts turns along a motion; a `JointReading` computes joint rates and accelerations from twists and
accelerations of bodies. `com_accelerations` and `shifted` convert accelerations to different reference points. `length`
is the characteristic length of a mechanism, which makes lengths dimensionless.

**Forces.** `acting` returns loads, springs, motors, dampers and friction as wrenches on bodies and forces along joint
coordinates, and `along_joints` returns only the forces along joint coordinates; `load_point` returns the point at which
a load acts; `resistance` computes the quantity of that name. `required_wrenches` computes the wrench that a motion
requires on each body (Newton-Euler equations) from its `Matter`, which `matter_of` reads from a description;
`summed_inwards` adds them up along a tree.

**Closed loops.** An engine that formulates bodies and constraints in its own coordinates is a `Constrained`:
`solve_constrained` solves a problem with it, for all quantities except tree forces, and estimates their errors; an
engine that also has an integrator is a `Stepped`, which `solve_stepwise` uses. `temporary` changes settings of a
library within a context. `solve_constrained` consists of these parts: `Closing` follows a motion from the assembly mode
of the home pose, given the `Placement` of coordinates; a `ClosedMotion` has rates, accelerations and forces; `min_norm`
and `along_line` are the rules for redundant actuators, `axial_line` returns the line for `along_line`;
`idle_accelerations` computes the accelerations of the `idle` coordinates of a `GivenMotion`, which no actuator drives;
`unit_wrenches` and `joint_wrenches` are the wrenches that joints exert, from their multipliers; `reactions` returns
components of wrenches at joints; `motion_values`, `force_values` and `inertia_values` return the quantities, and
`per_actuator` computes the `jacobian`. An engine whose unknowns are all joint coordinates follows the `Branch` of poses
that begins at the home pose and estimates its errors; `worst_of` merges condition numbers of quantities by their
maximum (`ACCELERATED` names the quantities that depend on accelerations).

**Errors.** Raise a `ScrewgaugeError` that says what is wrong, where, and what to do: `ModelFileError` (the model lacks
content that the engine needs, or contains something that the engine does not support), `DescriptionError`,
`UnknownNameError`, `ClosureError` (loops do not close), `SingularPoseError`. `check_fits` rejects a problem that does
not fit a description.

**Open trees.** An engine whose library supports trees but not loops implements `OpenTree` (and `Mover`, `TreeDynamics`
for simulations), and `BodyPoses`. `close_tree` closes its loops, given the tree and its `loops_file` (a
`LoopsFile`), and a `TreeModel` solves the result. `tree_urdf` reads a URDF whose fixed joints become hinges that
couplings lock. A port of MuJoCo may derive its tree from `MujocoTree`, which reads an MJCF with its closures and
couplings; its `open_model` returns the model without equality constraints.

**Tracer.** `Trace` records arithmetic on `Node` numbers; `program` compiles it to a `Program`, which `Lanes` runs
over samples; `apply` calls sqrt, sin, cos, atan2 or max on numbers of any kind. A `Function` is a program with names
for inputs and outputs. Derivatives are recorded in the same trace: `tangents` by forward mode, `adjoints` by reverse
mode; `substitute` replaces some numbers with others.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from screwgauge.engines.error_estimate import ACCELERATED, SolvedPart, Trust, worst_of
from screwgauge.engines.kit.acting import acting, along_joints, load_point, resistance
from screwgauge.engines.kit.answers import answer, force_values, inertia_values, motion_values, temporary
from screwgauge.engines.kit.branch import Branch
from screwgauge.engines.kit.closing import ClosedMotion, Closing, Placement
from screwgauge.engines.kit.constrained import Constrained, solve_constrained
from screwgauge.engines.kit.newton_euler import Matter, matter_of, required_wrenches, summed_inwards
from screwgauge.engines.kit.poses import (
    JointReading,
    absolute_poses,
    body_poses,
    com_accelerations,
    follow_joints,
    read_joints,
    shifted,
)
from screwgauge.engines.kit.projection import along_line, idle_accelerations, min_norm
from screwgauge.engines.kit.rates import per_actuator
from screwgauge.engines.kit.reactions import axial_line, joint_wrenches, reactions, unit_wrenches
from screwgauge.engines.kit.stepping import Stepped, solve_stepwise
from screwgauge.engines.registry import Engine, EngineModel
from screwgauge.models.catalog import load_mechanism
from screwgauge.problem import (
    GivenMotion,
    InitialValue,
    Integration,
    ModelFiles,
    Problem,
    Progress,
    States,
    check_fits,
    quiet,
)
from screwgauge.quantities import GIVEN, OF_MOTION, Names, length, stages
from screwgauge.quantities import description_names as names
from screwgauge.reference.applied import GRAVITY, Applied, JointSpring, Load, Motor, PointSpring
from screwgauge.reference.couplings import Coupling, PolynomialSum
from screwgauge.reference.courses import Course, Samples
from screwgauge.reference.errors import (
    ClosureError,
    DescriptionError,
    ModelFileError,
    ScrewgaugeError,
    SingularPoseError,
    UnknownNameError,
)
from screwgauge.reference.mechanism import GROUND, Body, Frame, Joint, Mechanism
from screwgauge.reference.points import Point
from screwgauge.reference.resistance import Resistance, resistances
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.derivatives import adjoints, substitute, tangents
from screwgauge.reference.traced.function import Function
from screwgauge.reference.traced.program import Lanes, Program, program
from screwgauge.reference.traced.trace import Node, Trace, apply
from screwgauge.solution import Clock, Error, Solution, Values

if TYPE_CHECKING:
    from screwgauge.engines.mujoco.tree import MujocoTree
    from screwgauge.engines.tree.closed_tree import close_tree
    from screwgauge.engines.tree.model import TreeModel, loops_file
    from screwgauge.engines.tree.protocol import BodyPoses, Mover, OpenTree, TreeDynamics
    from screwgauge.models.files.loops import LoopsFile
    from screwgauge.models.files.urdf import tree_urdf

__all__ = [
    "ACCELERATED",
    "GIVEN",
    "GRAVITY",
    "GROUND",
    "OF_MOTION",
    "Applied",
    "Array",
    "Body",
    "BodyPoses",
    "Branch",
    "Clock",
    "ClosedMotion",
    "Closing",
    "ClosureError",
    "Constrained",
    "Coupling",
    "Course",
    "DescriptionError",
    "Engine",
    "EngineModel",
    "Error",
    "Frame",
    "Function",
    "GivenMotion",
    "InitialValue",
    "Integration",
    "Joint",
    "JointReading",
    "JointSpring",
    "Lanes",
    "Load",
    "LoopsFile",
    "Matter",
    "Mechanism",
    "ModelFileError",
    "ModelFiles",
    "Motor",
    "Mover",
    "MujocoTree",
    "Names",
    "Node",
    "OpenTree",
    "Placement",
    "Point",
    "PointSpring",
    "PolynomialSum",
    "Problem",
    "Program",
    "Progress",
    "Resistance",
    "Samples",
    "ScrewgaugeError",
    "SingularPoseError",
    "Solution",
    "SolvedPart",
    "States",
    "Stepped",
    "Trace",
    "TreeDynamics",
    "TreeModel",
    "Trust",
    "UnknownNameError",
    "Values",
    "absolute_poses",
    "acting",
    "adjoints",
    "along_joints",
    "along_line",
    "answer",
    "apply",
    "axial_line",
    "body_poses",
    "check_fits",
    "close_tree",
    "com_accelerations",
    "follow_joints",
    "force_values",
    "idle_accelerations",
    "inertia_values",
    "joint_wrenches",
    "length",
    "load_mechanism",
    "load_point",
    "loops_file",
    "matter_of",
    "min_norm",
    "motion_values",
    "names",
    "per_actuator",
    "program",
    "quiet",
    "reactions",
    "read_joints",
    "required_wrenches",
    "resistance",
    "resistances",
    "shifted",
    "solve_constrained",
    "solve_stepwise",
    "stages",
    "substitute",
    "summed_inwards",
    "tangents",
    "temporary",
    "tree_urdf",
    "unit_wrenches",
    "worst_of",
]

_TREE = "screwgauge.engines.tree"
#: Modules that only engines with an open tree need, and whose import takes half of the time of all imports.
_HOMES = {
    "BodyPoses": f"{_TREE}.protocol",
    "LoopsFile": "screwgauge.models.files.loops",
    "Mover": f"{_TREE}.protocol",
    "MujocoTree": "screwgauge.engines.mujoco.tree",
    "OpenTree": f"{_TREE}.protocol",
    "TreeDynamics": f"{_TREE}.protocol",
    "TreeModel": f"{_TREE}.model",
    "close_tree": f"{_TREE}.closed_tree",
    "loops_file": f"{_TREE}.model",
    "tree_urdf": "screwgauge.models.files.urdf",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'screwgauge.plugins' has no attribute {name!r}")
