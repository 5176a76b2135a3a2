"""Closed loops in MuJoCo: constraints are soft springs, and nobody projects forces onto the actuators."""

from __future__ import annotations

import mujoco
import numpy as np

from screwgauge.engines.mujoco.discrepancies.probe import inverse, inverted, load, state
from screwgauge.engines.mujoco.equality_constraints import DISABLED, STIFFEST, refine
from screwgauge.engines.toy_models import Evidence, FourBar, body, mjcf
from screwgauge.reference.rotations import Array

_EXACT_DIAGONAL = int(getattr(mujoco.mjtEnableBit, "mjENBL_DIAGEXACT", 0))  # since 3.9
_ENERGY = int(mujoco.mjtEnableBit.mjENBL_ENERGY)


def needs_projection() -> Evidence:
    """The torque of the only motor of a four-bar in motion."""
    bar = FourBar()
    data = inverted(load(bar.mjcf()), v=bar.v, a=bar.a)
    tree = data.qfrc_inverse + data.qfrc_constraint
    motor = np.eye(3)[:, :1]
    system = np.hstack([motor, data.efc_J.reshape(-1, 3).T])
    projected = np.linalg.lstsq(system, tree, rcond=None)[0]
    return Evidence(float(data.qfrc_inverse[0]), bar.torque, float(projected[0]), "N m")


def speed_squared() -> Evidence:
    """Largest tree force that closed loops add to `mj_inverse` on a motion that closes them: as it comes, and with
    `qfrc_constraint` added."""
    bar = FourBar()
    model = load(bar.mjcf())
    data = inverted(model, v=bar.v, a=bar.a)
    closed, held = data.qfrc_inverse, data.qfrc_constraint
    model.opt.disableflags |= DISABLED
    tree = inverse(model, v=bar.v, a=bar.a)
    return Evidence(float(abs(closed - tree).max()), 0.0, float(abs(closed + held - tree).max()), "N m")


def residual_gain() -> Evidence:
    """What a closing error of 1e-6 rad adds to `mj_inverse` of stiff constraints, and what Newton's method leaves."""
    bar = FourBar()
    model = load(bar.mjcf())
    model.eq_solimp[:, :2] = STIFFEST
    right = inverse(model, v=bar.v, a=bar.a)[0]
    q = np.array([0.0, 0.0, 1e-6])
    off = inverse(model, q, bar.v, bar.a)[0] - right
    for _ in range(2):
        data = state(model, q)
        mujoco.mj_forward(model, data)
        J = data.efc_J.reshape(-1, 3)[:, 1:]  # the crank stays
        q[1:] -= np.linalg.lstsq(J, data.efc_pos, rcond=None)[0]
    return Evidence(float(off), 0.0, float(inverse(model, q, bar.v, bar.a)[0] - right), "N m")


def soft_floor() -> Evidence:
    """Largest error of the accelerations that the right torque makes, raw and after proximal refinement."""
    model = load(FourBar().mjcf())
    model.eq_solimp[:, :2] = STIFFEST
    raw, refined = _errors(model, 4)
    return Evidence(raw, 0.0, refined, "rad/s^2")


def _errors(model: mujoco.MjModel, passes: int) -> tuple[float, float]:
    """Largest error of a four-bar's accelerations under the right torque: as they come, and refined [rad/s^2]."""
    bar = FourBar()
    data = state(model, v=bar.v)
    data.qfrc_applied[0] = bar.torque
    mujoco.mj_forward(model, data)
    raw = data.qacc.copy()
    refined = raw.copy()
    refine(model, data, refined, passes, same=0.0)
    return float(abs(raw - bar.a).max()), float(abs(refined - bar.a).max())


def energy_loss() -> Evidence:
    """Change of energy of a four-bar that nothing brakes, in a second: solref as it comes, and ten times stiffer."""
    bar = FourBar()

    def lost(time_constant: float | None, step: float = 1e-3) -> float:
        model = load(bar.mjcf(), timestep=step, enableflags=_ENERGY)
        if time_constant is not None:
            model.eq_solref[:, 0] = time_constant
        data = state(model, v=bar.v)
        mujoco.mj_forward(model, data)
        first = data.energy.sum()
        mujoco.mj_step(model, data, round(1.0 / step))
        mujoco.mj_forward(model, data)
        return float(100.0 * (data.energy.sum() - first) / first)

    half = f"{lost(None, 5e-4):.3g}% at half the step"
    return Evidence(lost(None), 0.0, lost(2e-3), "%", half)


def exact_diagonal() -> Evidence:
    """Largest error of the accelerations with the flag for an exact diagonal: as they come, and refined."""
    (raw, refined), (usual, _) = (_errors(load(FourBar().mjcf(), enableflags=f), 20) for f in (_EXACT_DIAGONAL, 0))
    return Evidence(raw, 0.0, refined, "rad/s^2", f"{usual:.3g} rad/s^2 without the flag")


def anchor_at_home() -> Evidence:
    """Closing error of a dyad that is closed by hand at a pose other than that of the file."""
    inner = body("b", '<site name="tip" pos="0.3 0 0"/>', at="0.3 0 0")
    world = '<site name="ground" pos="0.3 0 0.3"/>'
    gaps = []
    for sides in ('body1="b" anchor="0.3 0 0"', 'site1="tip" site2="ground"'):
        text = mjcf(world + body("a", inner), after=f"<equality><connect {sides}/></equality>")
        model = load(text)
        data = state(model, [0.0, -np.pi / 2])  # the tip is at (0.3, 0, 0.3)
        mujoco.mj_forward(model, data)
        gaps.append(float(np.linalg.norm(data.efc_pos)))
    return Evidence(gaps[0], 0.0, gaps[1], "m")


def weld_rows() -> Evidence:
    """Moment that holds a welded body against 1 N m: as the rows of the weld have it, and converted."""
    holding = body("a").replace("<joint", '<joint name="x" axis="1 0 0"/><joint')
    model = load(mjcf(holding, before='<option gravity="0 0 0"/>', after='<equality><weld body1="a"/></equality>'))
    model.eq_solimp[:, :2] = STIFFEST
    data = state(model)
    data.qfrc_applied[0] = 1.0
    mujoco.mj_forward(model, data)
    rows = -data.efc_force[3:6]
    scale = model.eq_data[0, 10] / 2.0  # torquescale: the rows are those of its product with sin(angle / 2)
    return Evidence(float(rows[0]), 1.0, float(rows[0] * scale), "N m")


def sparse_hessian() -> Evidence:
    """Largest acceleration error of two closed dyads among four, sparse and dense, against the linear system solved
    here."""
    places = [(k, f"0 {0.1 * k} 0") for k in range(4)]
    arms = "".join(_spatial(f"p{k}", at, _spatial(f"q{k}", "0.2 0 0", "", k + 1), k) for k, at in places)
    closures = "".join(f'<connect body1="q0" body2="p{k}" anchor="0.1 0 0"/>' for k in (2, 3))
    model = load(mjcf(arms, after=f"<equality>{closures}</equality>"))
    accelerations, iterations = [], []
    for kind in (mujoco.mjtJacobian.mjJAC_SPARSE, mujoco.mjtJacobian.mjJAC_DENSE):
        model.opt.jacobian = kind
        data = state(model)
        mujoco.mj_forward(model, data)
        accelerations.append(np.array(data.qacc))
        iterations.append(int(data.solver_niter.sum()))
    right = _soft(model, data)
    sparse, dense = (float(abs(a - right).max()) for a in accelerations)
    return Evidence(sparse, 0.0, dense, "rad/s^2", f"{iterations[0]} iterations")


def _spatial(name: str, at: str, inside: str, k: int) -> str:
    axis = ("1 0 0", "0 1 0", "0 0 1")[k % 3]
    inertial = '<inertial pos="0.1 0.05 0.02" mass="1" diaginertia="0.01 0.01 0.01"/>'
    return f'<body name="{name}" pos="{at}"><joint axis="{axis}"/>{inertial}{inside}</body>'


def _soft(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """Accelerations of soft equality constraints: (M + J^T D J) a = M a_free + J^T D a_ref."""
    nv = model.nv
    M = np.column_stack([_times_mass(model, data, column) for column in np.eye(nv)])
    J, D = data.efc_J.reshape(-1, nv), data.efc_D
    return np.linalg.solve(M + J.T @ (D[:, None] * J), M @ data.qacc_smooth + J.T @ (D * data.efc_aref))


def _times_mass(model: mujoco.MjModel, data: mujoco.MjData, column: Array) -> Array:
    out = np.empty(model.nv)
    mujoco.mj_mulM(model, data, out, column)
    return out
