import mujoco_warp
import numpy as np

from casebook.mujoco_discrepancies import inverse, load
from casebook.toy_models import Evidence, FourBar
from screwgauge.engines.mujoco.equality_constraints import DISABLED


def speed_squared() -> Evidence:
    bar = FourBar()
    model = load(bar.mjcf())
    made, data = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=1)
    for name, values in (("qpos", model.qpos0), ("qvel", bar.v), ("qacc", bar.a)):
        getattr(data, name).assign(np.array([values], dtype=np.float32))
    mujoco_warp.inverse(made, data)
    closed, held = (x.numpy()[0].astype(float) for x in (data.qfrc_inverse, data.qfrc_constraint))
    model.opt.disableflags |= DISABLED
    tree = inverse(model, v=bar.v, a=bar.a)
    return Evidence(float(abs(closed - tree).max()), 0.0, float(abs(closed + held - tree).max()), "N m")
