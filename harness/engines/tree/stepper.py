"""The engines' own steppers at a fixed step: what their users would run, beside what their accelerations allow.

`integrate_steps(problem, Stepper(...))` steps any scene's model. A mechanism that is held by constant joint forces is a
problem whose motors are `hold({coordinate: force})`; `opening` then says how far its loops opened.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from screwgauge.engines.tree.closure import make_loops
from screwgauge.engines.tree.protocol import Tree
from screwgauge.engines.tree.start import loops_file
from screwgauge.models.loops import LoopsFile
from screwgauge.problem import ForwardProblem
from screwgauge.reference.applied import Motor
from screwgauge.reference.errors import DescriptionError, check_choice
from screwgauge.reference.rotations import Array
from screwgauge.solution import ForwardSolution

#: Integrators by engine. MuJoCo's ``discrete`` needs 4.0.
INTEGRATORS = {
    "mujoco": ("Euler", "implicit", "implicitfast", "RK4", "discrete"),
    "pinocchio": ("Euler", "RK4"),
}
#: Those of MuJoCo whose step can be made from refined accelerations: the others solve for them inside.
REFINABLE = ("Euler", "implicit", "implicitfast")


@dataclass(frozen=True, slots=True)
class Stepper:
    """An engine's stepper and its settings; None leaves what the engine has by default.

    Attributes:
        engine: ``mujoco``, or ``pinocchio`` (semi-implicit Euler and RK4, brought back onto the loops every step).
        integrator: One of `INTEGRATORS`.
        dt: Step [s]; it is shortened so that steps end at the wanted times.
        solref: MuJoCo's time constant [s] and damping ratio of the equality constraints.
        solimp: MuJoCo's impedance d of the equality constraints, the same at any gap; at most 0.9999.
        passes: Proximal refinements of MuJoCo's accelerations, at most, in every step.
    """

    engine: str
    integrator: str
    dt: float
    solref: tuple[float, float] | None = None
    solimp: float | None = None
    passes: int = 0

    def __post_init__(self) -> None:
        where = f"stepper of {self.engine}"
        check_choice("engine", [self.engine], INTEGRATORS, "stepper")
        check_choice("integrator", [self.integrator], INTEGRATORS[self.engine], where)
        if not 0.0 < self.dt < np.inf:
            raise DescriptionError(f"step {self.dt:g} s", where, "give a positive number")
        soft = self.passes or self.solref is not None or self.solimp is not None
        if self.engine != "mujoco" and soft:
            raise DescriptionError("its constraints are rigid", where, "leave solref, solimp and passes out")
        if self.passes and self.integrator not in REFINABLE:
            raise DescriptionError(
                f"{self.integrator} solves for accelerations inside its step",
                where,
                f"refine one of {', '.join(REFINABLE)}, or leave passes out",
            )

    @property
    def setting(self) -> str:
        """In words."""
        if self.engine == "pinocchio":
            name = "semi-implicit Euler" if self.integrator == "Euler" else self.integrator
            return f"{name} with projection, dt {self.dt:g} s"
        parts = [f"{self.integrator}, dt {self.dt:g} s"]
        parts.append("solref default" if self.solref is None else f"solref {self.solref[0]:g} {self.solref[1]:g}")
        parts.append("solimp default" if self.solimp is None else f"solimp {self.solimp:g}")
        parts.append(f"at most {self.passes} refinements" if self.passes else "raw")
        return ", ".join(parts)


def hold(forces: Mapping[str, float]) -> tuple[Motor, ...]:
    """Motors of constant force by joint coordinate [N or N m]."""
    return tuple(Motor(name, np.array([float(f)]), np.zeros((0, 3))) for name, f in forces.items())


def integrate_steps(problem: ForwardProblem, stepper: Stepper) -> ForwardSolution:
    """Steps through a problem. Its method is not looked at.

    Raises:
        ScrewgaugeError: A model, start or force that cannot be.
    """
    module = import_module(f"screwgauge.engines.{stepper.engine}.steps")
    found: ForwardSolution = module.integrate(problem, stepper)
    return found


def opening(problem: ForwardProblem, found: ForwardSolution) -> Array:
    """How far the loops of a solution are open, the largest distance of points that should meet [m].

    Only closures by points, as in the minimal cut. Shape (m,).
    """
    file = loops_file(problem)
    tree = _tree(problem, file)
    names = [name for joint in file.joints for name in joint.coordinates]
    at = tree.poses(found.q[:, [names.index(name) for name in tree.coordinates]])
    loops = make_loops(tree, file)
    points = np.repeat(np.array([not anchor.angular for anchor in loops.anchors], dtype=bool), 3)
    gaps = loops.gaps(at)[:, points].reshape(len(found.q), -1, 3)
    return np.asarray(np.linalg.norm(gaps, axis=2).max(axis=1, initial=0.0))


def _tree(problem: ForwardProblem, file: LoopsFile) -> Tree:
    """The open tree of a problem's model, by its ending."""
    if problem.model.suffix == ".urdf":
        from screwgauge.engines.pinocchio.tree import PinocchioTree

        return PinocchioTree(problem.model, file, problem.gravity)
    from screwgauge.engines.mujoco.tree import MujocoTree

    return MujocoTree(problem.model, file, problem.gravity)
