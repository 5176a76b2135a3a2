"""Everything that an engine of another package imports: question, description, answer, and functions for common steps.

``from screwgauge.plugins import ...`` is the only import of this package that an engine needs. Names and meanings
below stay within a major version; modules behind them may move in any version.

Conventions. SI units; angles in rad. Arrays run over samples first. Bodies are those of the description in its order,
ground before them at 0: orientations R have shape (n, n_body + 1, 3, 3), origins p (n, n_body + 1, 3). World axes
unless said otherwise. Wrenches (..., 6) are force, then moment about a named point; twists (..., 6), and
accelerations of bodies, are angular, then of the body's origin, as in `OpenTree`. `Array` is the type of all of these.

**Entry.** `Engine` describes an engine to the registry: ``module:function`` that loads it, its tasks, its package.
That function takes `ModelFiles` and returns a model with ``solve(problem, progress)``, an `EngineModel`. A `Progress`
takes the share of the work that is done, 0 to 1; `quiet` shows nothing. An engine that can compute in float32 lists it,
``precisions=("float64", "float32")``, and its function takes ``precision="float32"`` where a user names it
``NAME@float32``; its answers are arrays of float64 in any case.

**Question.** A `Problem` has a task, what acts, names of wanted quantities and the rule for redundant actuators.
Tasks are `GivenMotion` (inverse dynamics), `InitialValue` (simulation, by an `Integration`) and `States` (an open
tree as it is). `Applied` holds gravity (`GRAVITY` where none is given), each `Load`, springs (`JointSpring`,
`PointSpring`) and each `Motor`. `GIVEN` names the quantities that are asked of a given motion by default, `OF_MOTION`
all that can be.

**Description.** `load_mechanism` reads a `Mechanism` of `Body`, `Joint` (with a `Frame` on each side) and couplings
(`Coupling`, a `PolynomialSum`; `Fixing` holds a fixed joint). `GROUND` is the name of the ground. `resistances` lists
rotors, dampers and dry friction as `Resistance`.

**Answer.** A `Solution` has `Values` by quantity, and may have an `Error` for each. `names` gives components and
units of each quantity in order; `Names` is their type. A `Clock` takes the time of each stage.

**Errors.** Raise a `ScrewgaugeError`, each with what, where and what to do: `ModelFileError` (the model lacks or has
what the engine cannot take), `DescriptionError`, `UnknownNameError`, `ClosureError` (loops do not close),
`SingularPoseError`. `check_fits` refuses a problem that is not that of a description.

**Open trees.** An engine whose library has a tree and no loops implements `OpenTree` (and `Mover`, `TreeDynamics` for
simulations), gives `BodyPoses`, and is closed by a `TreeModel` of `close_tree` of tree and
`loops_file`. `shifted` moves accelerations to other points of bodies.

**Tracer.** `Trace` records arithmetic on `Node` numbers; `program` makes a `Program` of it, `Lanes` runs that over
samples; `apply` calls sqrt, sin, cos, atan2 or max on numbers of any kind. A `Function` is a program with names for
inputs and outputs. Derivatives are recorded in the same trace: `tangents` by forward mode, `adjoints` by reverse mode;
`substitute` puts other numbers in the place of some.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from screwgauge.engines.chunks import Names, check_fits
from screwgauge.engines.chunks import described as names
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
    quiet,
)
from screwgauge.quantities import GIVEN, OF_MOTION
from screwgauge.reference.applied import GRAVITY, Applied, JointSpring, Load, Motor, PointSpring
from screwgauge.reference.couplings import Coupling, Fixing, PolynomialSum
from screwgauge.reference.errors import (
    ClosureError,
    DescriptionError,
    ModelFileError,
    ScrewgaugeError,
    SingularPoseError,
    UnknownNameError,
)
from screwgauge.reference.mechanism import GROUND, Body, Frame, Joint, Mechanism
from screwgauge.reference.resistance import Resistance, resistances
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.derivatives import adjoints, substitute, tangents
from screwgauge.reference.traced.function import Function
from screwgauge.reference.traced.program import Lanes, Program, program
from screwgauge.reference.traced.trace import Node, Trace, apply
from screwgauge.solution import Clock, Error, Solution, Values

if TYPE_CHECKING:
    from screwgauge.engines.tree.closed_tree import close_tree
    from screwgauge.engines.tree.model import TreeModel, loops_file
    from screwgauge.engines.tree.protocol import BodyPoses, Mover, OpenTree, TreeDynamics, shifted

__all__ = [
    "GIVEN",
    "GRAVITY",
    "GROUND",
    "OF_MOTION",
    "Applied",
    "Array",
    "Body",
    "BodyPoses",
    "Clock",
    "ClosureError",
    "Coupling",
    "DescriptionError",
    "Engine",
    "EngineModel",
    "Error",
    "Fixing",
    "Frame",
    "Function",
    "GivenMotion",
    "InitialValue",
    "Integration",
    "Joint",
    "JointSpring",
    "Lanes",
    "Load",
    "Mechanism",
    "ModelFileError",
    "ModelFiles",
    "Motor",
    "Mover",
    "Names",
    "Node",
    "OpenTree",
    "PointSpring",
    "PolynomialSum",
    "Problem",
    "Program",
    "Progress",
    "Resistance",
    "ScrewgaugeError",
    "SingularPoseError",
    "Solution",
    "States",
    "Trace",
    "TreeDynamics",
    "TreeModel",
    "UnknownNameError",
    "Values",
    "adjoints",
    "apply",
    "check_fits",
    "close_tree",
    "load_mechanism",
    "loops_file",
    "names",
    "program",
    "quiet",
    "resistances",
    "shifted",
    "substitute",
    "tangents",
]

_TREE = "screwgauge.engines.tree"
#: Modules that only engines with an open tree need, and that take half of the time of all imports.
_HOMES = {
    "BodyPoses": f"{_TREE}.protocol",
    "Mover": f"{_TREE}.protocol",
    "OpenTree": f"{_TREE}.protocol",
    "TreeDynamics": f"{_TREE}.protocol",
    "TreeModel": f"{_TREE}.model",
    "close_tree": f"{_TREE}.closed_tree",
    "loops_file": f"{_TREE}.model",
    "shifted": f"{_TREE}.protocol",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'screwgauge.plugins' has no attribute {name!r}")
