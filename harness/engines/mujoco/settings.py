"""How MuJoCo is set: softness of its equality constraints, its own integrators.

The softness is taken out again by proximal refinement.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice
from screwgauge.reference.rotations import Array

#: Integrators by MuJoCo's name; ``discrete`` needs 4.0.
INTEGRATORS = {
    "Euler": "mjINT_EULER",
    "implicit": "mjINT_IMPLICIT",
    "implicitfast": "mjINT_IMPLICITFAST",
    "RK4": "mjINT_RK4",
    "discrete": "mjINT_DISCRETE",
}
#: Those whose step can be made from refined accelerations: the others solve for them inside.
REFINABLE = ("Euler", "implicit", "implicitfast")
#: The largest impedance d that MuJoCo takes: every pass divides the error by about d / (1 - d) = 1e4.
STIFFEST = 0.9999
#: Rows are harder by this than the largest impedance makes them: their regularisation is (1 - d) / d times the mean
#: inverse mass of the bodies (body_invweight0), which is divided by it. Next to singular poses the passes converge
#: slowly: A02 stops there with 1 (N = 2) or 10 (N = 40) and 20 passes, with 1000 no more than 8 are needed.
HARDER = 1000.0
#: Passes end when none of the accelerations changed by more than this share of the largest, or after so many.
SAME, PASSES = 1e-13, 20
#: The solver's own error stays below the softness that is looked at.
EXACT = 1e-15
EQUALITY = int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
_AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
_VEL = int(mujoco.mjtStage.mjSTAGE_VEL)


def harden(model: mujoco.MjModel) -> None:
    """Makes the equality constraints as hard as they get, without springs that pull closing errors in.

    With solref (0, 0) the reference acceleration is that of the closed loop, -Jdot v: its own springs and dampers
    (100 per second by default) would make every motion stiff.
    """
    model.opt.disableflags &= ~EQUALITY
    model.opt.tolerance = EXACT
    model.eq_solimp[:, :2] = STIFFEST
    model.body_invweight0[:] /= HARDER
    if (model.eq_type == mujoco.mjtEq.mjEQ_JOINT).any():  # a screw of 10 mm lead is softer by 1e4 than a gear
        model.dof_invweight0[:] /= HARDER
    model.eq_solref[:] = 0.0


def refine(
    model: mujoco.MjModel, data: mujoco.MjData, a: Array, passes: int, *, same: float = SAME, total: Array | None = None
) -> tuple[int, float]:
    """Proximal refinement: the last constraint force is applied from outside and the accelerations solved again.

    Args:
        a: Accelerations so far, and in the end the refined ones. Shape (n_v,).
        passes: At most so many.
        same: Share of the largest acceleration below which a change ends it; with 0 all passes are made.
        total: Constraint forces so far, to which those of the passes are added. Shape (n_row,).

    Returns:
        How many were made, and the largest change in the last one.
    """
    change = 0.0
    for made in range(1, passes + 1):
        data.qfrc_applied[:] += _closing_pull(model, data)
        mujoco.mj_forwardSkip(model, data, _VEL, 1)
        before, change = change, float(abs(data.qacc - a).max())
        a[:] = data.qacc
        if total is not None:
            total += data.efc_force[: data.nefc]
        if same and (change <= same * float(abs(a).max()) or (made > 2 and not change < before)):
            return made, change
    return passes, change


def _closing_pull(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Forces of the equality constraints along the coordinates; their rows come first.

    Friction, limits and contacts of a file of the user's own close no loop: they stay as soft as MuJoCo makes them.
    """
    if data.ne == data.nefc:
        return np.asarray(data.qfrc_constraint)
    J = data.efc_J[: data.ne * model.nv].reshape(data.ne, model.nv)
    return np.asarray(J.T @ data.efc_force[: data.ne])


@dataclass(frozen=True, slots=True)
class MujocoSettings:
    """How accelerations and steps are made; None leaves what the file or MuJoCo says.

    Scipy's methods take none of them: they integrate refined accelerations of constraints as hard as they get.

    Attributes:
        solimp: Impedance d of the equality constraints, the same at any closure residual; at most 0.9999.
        solref: Time constant [s] of their springs, or that and the damping ratio.
        passes: Proximal refinements: all of them on given states, at most so many in a step.
        naive: What `mj_inverse` says of the actuated joints, equality constraints on, is taken for their forces.
        weld: Loops are closed by welds of the frames of cut joints, which agree at each given state.
        examine: Conditioning of given states is looked at.
        integrator, dt: One of `INTEGRATORS` with its step [s]; None for scipy's methods.
        work: Its steps are looked at one by one for the work that is put in, which takes longer than the steps.
    """

    solimp: float | None = None
    solref: float | tuple[float, float] | None = None
    passes: int = 0
    naive: bool = False
    weld: bool = False
    examine: bool = False
    integrator: str = "Euler"
    dt: float | None = None
    work: bool = True

    def __post_init__(self) -> None:
        where = "stepper of mujoco"
        check_choice("integrator", [self.integrator], INTEGRATORS, where)
        if self.dt is not None and not 0.0 < self.dt < np.inf:
            raise DescriptionError(f"step {self.dt:g} s", where, "give a positive number")
        if self.solimp is not None and not 0.0 < self.solimp <= STIFFEST:
            raise DescriptionError(f"solimp {self.solimp:g}", where, "give a number up to 0.9999")
        if self.dt is not None and self.passes and self.integrator not in REFINABLE:
            raise DescriptionError(
                f"{self.integrator} solves for accelerations inside its step",
                where,
                f"refine one of {', '.join(REFINABLE)}, or leave passes out",
            )

    def soften(self, model: mujoco.MjModel) -> None:
        """Sets the equality constraints, switched on."""
        model.opt.disableflags &= ~EQUALITY
        if self.solimp is not None:
            model.eq_solimp[:, :2] = self.solimp
        if self.solref is not None:
            model.eq_solref[:, : np.size(self.solref)] = self.solref

    def set_steps(self, model: mujoco.MjModel) -> None:
        """Sets constraints and integrator for steps.

        Raises:
            UnknownNameError: This version of MuJoCo has no such integrator.
        """
        kind = getattr(mujoco.mjtIntegrator, INTEGRATORS[self.integrator], None)
        if kind is None:
            raise UnknownNameError("integrator", self.integrator, INTEGRATORS, f"MuJoCo {mujoco.__version__}")
        self.soften(model)
        model.opt.integrator = kind
        model.opt.timestep = self.dt or model.opt.timestep  # `discrete` accelerations depend on it
        model.opt.disableflags |= _AUTORESET  # a state that is not finite is to be seen
        if self.passes:
            model.opt.tolerance = EXACT

    @property
    def steps(self) -> str:
        """The stepper in words."""
        solref = self.solref if isinstance(self.solref, tuple) else (self.solref,)
        spring = " ".join("default" if x is None else f"{x:g}" for x in solref)
        return f"{self.integrator}, dt {self.dt:g} s, solref {spring}, {self._constraints('at most ')}"

    @property
    def states(self) -> str:
        """Accelerations of given states in words."""
        return f"mj_forward, {self._constraints()}"

    def _constraints(self, most: str = "") -> str:
        solimp = "default" if self.solimp is None else f"{self.solimp:g}"
        return f"solimp {solimp}, {f'{most}{self.passes} refinements' if self.passes else 'raw'}"
