"""How MuJoCo is set: softness of its equality constraints, refinement, its own integrators."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from screwgauge.engines.mujoco.softness import EQUALITY, EXACT
from screwgauge.reference.errors import DescriptionError, UnknownNameError, check_choice

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
STIFFEST = 0.9999  # the largest impedance that MuJoCo takes
_AUTORESET = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


@dataclass(frozen=True, slots=True)
class Settings:
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
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE  # sparse ones are wrong in 4.0.0 (issue 3767)
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


def has_integrator(name: str) -> bool:
    """Whether this version of MuJoCo has an integrator."""
    return hasattr(mujoco.mjtIntegrator, INTEGRATORS[name])
