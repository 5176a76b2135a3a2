"""Discrepancies that users of MuJoCo meet, each as a function that shows it on a small model.

First what MuJoCo counts among forces and accelerations, and what it leaves out; then closed loops: constraints are soft
springs, and nobody projects forces onto the actuators.
"""

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from casebook.toy_models import ARM, INERTIA, MASS, WEIGHT, Evidence, FourBar, G, body, mjcf
from screwgauge.engines.mujoco.equality_constraints import DISABLED, STIFFEST, refine
from screwgauge.reference.rotations import Array


def load(text: str, **options: Any) -> mujoco.MjModel:
    model = mujoco.MjModel.from_xml_string(text)
    for name, value in options.items():
        setattr(model.opt, name, value)
    return model


def state(model: mujoco.MjModel, q: Any = None, v: Any = 0.0) -> mujoco.MjData:
    """Data at coordinates and velocities."""
    data = mujoco.MjData(model)
    data.qvel[:] = v
    if q is not None:
        data.qpos[:] = q
    return data


def inverted(model: mujoco.MjModel, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> mujoco.MjData:
    """Data after `mj_inverse`."""
    data = state(model, q, v)
    data.qacc[:] = a
    mujoco.mj_inverse(model, data)
    return data


def inverse(model: mujoco.MjModel, q: Any = None, v: Any = 0.0, a: Any = 0.0) -> Array:
    """Forces of `mj_inverse`. Shape (n_v,)."""
    return np.array(inverted(model, q, v, a).qfrc_inverse)


def measured(text: str, measure: Callable[[mujoco.MjModel], float]) -> tuple[float, str]:
    try:
        model = load(text)
    except ValueError as error:
        return math.nan, str(error).splitlines()[0].removeprefix("Error: ")
    return measure(model), ""


def moment(model: mujoco.MjModel) -> float:
    a = np.eye(model.nv)[0]
    return float(inverse(model, a=a)[0] - inverse(model)[0])


def mass(model: mujoco.MjModel) -> float:
    """Moving mass [kg]."""
    return float(model.body_mass[1:].sum())


_DISCRETE = int(mujoco.mjtEnableBit.mjENBL_INVDISCRETE)


def rne_armature() -> Evidence:
    armature = 0.5
    model = load(mjcf(body("a", joint=f'armature="{armature}"')))
    data = inverted(model, a=1.0)
    force = np.empty(1)
    mujoco.mj_rne(model, data, 1, force)
    mended = force[0] + model.dof_armature[0] * data.qacc[0]
    return Evidence(float(force[0]), INERTIA + armature + WEIGHT, float(mended), "N m")


def passive_forces() -> Evidence:
    model = load(mjcf(body("a", joint='damping="2" stiffness="3" springref="0.4" frictionloss="0.5"')))
    data = inverted(model, v=1.0)
    mended = data.qfrc_inverse + data.qfrc_passive + data.qfrc_constraint
    return Evidence(float(data.qfrc_inverse[0]), WEIGHT, float(mended[0]), "N m")


def limit_force() -> Evidence:
    model = load(mjcf(body("a", joint='range="-0.3 0.3"')))
    data = inverted(model, 0.4)
    mended = data.qfrc_inverse + data.qfrc_constraint
    return Evidence(float(data.qfrc_inverse[0]), float(WEIGHT * np.cos(0.4)), float(mended[0]), "N m")


def contact_force() -> Evidence:
    ball = '<body pos="0 0 0.049"><joint type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/></body>'
    model = load(mjcf(f'<geom type="plane" size="1 1 1"/>{ball}'))
    raw = inverse(model)[0]
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return Evidence(float(raw), G, float(inverse(model)[0]), "N")


def applied_ignored() -> Evidence:
    model = load(mjcf(body("a")))
    data = state(model)
    data.xfrc_applied[1, 2] = MASS * G / 2.0
    mujoco.mj_inverse(model, data)
    load_force = np.zeros(1)
    force, torque = np.split(data.xfrc_applied[1], 2)
    mujoco.mj_applyFT(model, data, force, torque, data.xipos[1], 1, load_force)
    raw = float(data.qfrc_inverse[0])
    return Evidence(raw, WEIGHT / 2.0, raw - float(load_force[0]), "N m")


def gravity_in_acceleration() -> Evidence:
    sensor = '<sensor><framelinacc objtype="body" objname="a"/></sensor>'
    model = load(mjcf(body("a", joint='stiffness="1e3"'), after=sensor))
    data = state(model)
    data.qfrc_applied[0] = WEIGHT  # holds it
    mujoco.mj_forward(model, data)
    reading = float(data.sensordata[2])
    return Evidence(reading, 0.0, reading + float(model.opt.gravity[2]), "m/s^2")


def moment_about_centre() -> Evidence:
    model = load(mjcf(body("a")))
    data = inverted(model)
    mujoco.mj_rnePostConstraint(model, data)
    moment, force = np.split(data.cfrc_int[1], 2)
    arm = data.subtree_com[model.body_rootid[1]] - data.xanchor[0]
    return Evidence(float(moment[1]), WEIGHT, float((moment + np.cross(arm, force))[1]), "N m")


def gear() -> Evidence:
    wanted, ratio = 2.0, 50.0
    motor = f'<actuator><motor joint="a" gear="{ratio}"/></actuator>'
    model = load(mjcf(body("a"), after=motor))
    torques = []
    for control in (wanted, wanted / model.actuator_gear[0, 0]):
        data = state(model)
        data.ctrl[0] = control
        mujoco.mj_forward(model, data)
        torques.append(float(data.qfrc_actuator[0]))
    return Evidence(torques[0], wanted, torques[1], "N m")


def inverse_of_a_step() -> Evidence:
    model = load(mjcf(body("a", joint='damping="5"')), timestep=0.01)
    data = state(model, v=1.0)
    mujoco.mj_step(model, data)
    a = (data.qvel - 1.0) / model.opt.timestep
    raw = inverse(model, v=1.0, a=a)
    model.opt.enableflags |= _DISCRETE
    return Evidence(float(raw[0]), 0.0, float(inverse(model, v=1.0, a=a)[0]), "N m")


def stale_after_step() -> Evidence:
    model = load(mjcf(body("a")), timestep=0.01)
    data = state(model, v=10.0)
    mujoco.mj_step(model, data)

    def lag() -> float:
        q = data.qpos[0]
        return float(np.linalg.norm(data.xipos[1] - ARM * np.array([np.cos(q), 0.0, -np.sin(q)])))

    stale = lag()
    mujoco.mj_forward(model, data)
    return Evidence(stale, 0.0, lag(), "m")


def differentiated_motion() -> Evidence:
    model, omega = load(mjcf(body("a"))), 4.0
    t = np.arange(0.0, 0.3, 0.01)
    q, v, a = np.sin(omega * t), omega * np.cos(omega * t), -(omega**2) * np.sin(omega * t)
    right = INERTIA * a + WEIGHT * np.cos(q)

    def error(accelerations: np.ndarray) -> float:
        torques = [inverse(model, *at)[0] for at in zip(q, v, accelerations, strict=True)]
        return float(abs(torques - right).max())

    return Evidence(error(np.gradient(np.gradient(q, t), t)), 0.0, error(a), "N m")


def many_motors() -> Evidence:
    bar = FourBar()
    data = inverted(load(bar.mjcf()), v=bar.v, a=bar.a)
    tree, J = data.qfrc_inverse + data.qfrc_constraint, data.efc_J.reshape(-1, 3).T
    moving = bar.v / bar.speed  # rates per rate of the crank
    answers = []
    for motors in (np.eye(3)[:, :1], np.eye(3)[:, [0, 2]]):
        solved = np.linalg.lstsq(np.hstack([motors, J]), tree, rcond=None)[0]
        torques = motors @ solved[: motors.shape[1]]
        answers.append((torques[0], torques @ moving))
    (first, of_first), (second, of_second) = answers
    return Evidence(float(abs(first - second)), 0.0, float(abs(of_first - of_second)), "N m")


_EXACT_DIAGONAL = int(getattr(mujoco.mjtEnableBit, "mjENBL_DIAGEXACT", 0))  # since 3.9
_ENERGY = int(mujoco.mjtEnableBit.mjENBL_ENERGY)


def needs_projection() -> Evidence:
    bar = FourBar()
    data = inverted(load(bar.mjcf()), v=bar.v, a=bar.a)
    tree = data.qfrc_inverse + data.qfrc_constraint
    motor = np.eye(3)[:, :1]
    system = np.hstack([motor, data.efc_J.reshape(-1, 3).T])
    projected = np.linalg.lstsq(system, tree, rcond=None)[0]
    return Evidence(float(data.qfrc_inverse[0]), bar.torque, float(projected[0]), "N m")


def speed_squared() -> Evidence:
    bar = FourBar()
    model = load(bar.mjcf())
    data = inverted(model, v=bar.v, a=bar.a)
    closed, held = data.qfrc_inverse, data.qfrc_constraint
    model.opt.disableflags |= DISABLED
    tree = inverse(model, v=bar.v, a=bar.a)
    return Evidence(float(abs(closed - tree).max()), 0.0, float(abs(closed + held - tree).max()), "N m")


def residual_gain() -> Evidence:
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
    model = load(FourBar().mjcf())
    model.eq_solimp[:, :2] = STIFFEST
    raw, refined = _errors(model, 4)
    return Evidence(raw, 0.0, refined, "rad/s^2")


def _errors(model: mujoco.MjModel, passes: int) -> tuple[float, float]:
    bar = FourBar()
    data = state(model, v=bar.v)
    data.qfrc_applied[0] = bar.torque
    mujoco.mj_forward(model, data)
    raw = data.qacc.copy()
    refined = raw.copy()
    refine(model, data, refined, passes, same=0.0)
    return float(abs(raw - bar.a).max()), float(abs(refined - bar.a).max())


def energy_loss() -> Evidence:
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
    (raw, refined), (usual, _) = (_errors(load(FourBar().mjcf(), enableflags=f), 20) for f in (_EXACT_DIAGONAL, 0))
    return Evidence(raw, 0.0, refined, "rad/s^2", f"{usual:.3g} rad/s^2 without the flag")


def anchor_at_home() -> Evidence:
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
