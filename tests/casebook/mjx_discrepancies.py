import math
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

from casebook.mujoco_discrepancies import inverse, inverted, load
from casebook.toy_models import Evidence, FourBar, body, mjcf
from screwgauge.engines.mujoco.equality_constraints import DISABLED


def port(model: mujoco.MjModel, v: Any = 0.0, a: Any = 0.0, *, q: Any = None, double: bool = True) -> Any:
    n = model.nv
    with jax.enable_x64(double):
        state = [jax.numpy.zeros(n) + np.asarray(x) for x in (model.qpos0 if q is None else q, v, a)]
        made = mjx.put_model(model)
        data = mjx.make_data(made).replace(qpos=state[0], qvel=state[1], qacc=state[2])
        return made, mjx.inverse(made, data)


def half_the_digits() -> Evidence:
    model, q = load(mjcf(body("a"))), [0.3]
    right = inverse(model, q)[0]
    off = [float(port(model, q=q, double=double)[1].qfrc_inverse[0]) - right for double in (False, True)]
    return Evidence(float(abs(off[0])), 0.0, float(abs(off[1])), "N m")


def speed_squared() -> Evidence:
    bar = FourBar()
    model = load(bar.mjcf())
    data = port(model, bar.v, bar.a)[1]
    closed, held = (np.asarray(x) for x in (data.qfrc_inverse, data.qfrc_constraint))
    model.opt.disableflags |= DISABLED
    tree = inverse(model, v=bar.v, a=bar.a)
    return Evidence(float(abs(closed - tree).max()), 0.0, float(abs(closed + held - tree).max()), "N m")


def loops_off() -> Evidence:
    bar = FourBar()
    flagged, spec = load(bar.mjcf()), mujoco.MjSpec.from_string(bar.mjcf())
    flagged.opt.disableflags |= DISABLED
    for constraint in [*spec.equalities]:
        spec.delete(constraint)
    alone, native = spec.compile(), inverted(flagged, v=bar.v, a=bar.a)
    mujoco.mj_rnePostConstraint(flagged, native)
    try:
        found, said = _transmitted(flagged, bar), ""
    except TypeError as error:
        found, said = math.nan, str(error).splitlines()[0]
    return Evidence(found, float(np.linalg.norm(native.cfrc_int[-1, 3:])), _transmitted(alone, bar), "N", said)


def _transmitted(model: mujoco.MjModel, bar: FourBar) -> float:
    made, data = port(model, bar.v, bar.a)
    with jax.enable_x64(True):
        felt = np.asarray(mjx.rne_postconstraint(made, data)._impl.cfrc_int)
    return float(np.linalg.norm(felt[-1, 3:]))
