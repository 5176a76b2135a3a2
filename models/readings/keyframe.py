"""The home pose that an MJCF names."""

from __future__ import annotations

from pathlib import Path

from screwgauge.models.readings.mujoco import quiet
from screwgauge.models.readings.source import prepare

#: Keyframe that users of MJCF call so.
HOME = "home"


def home_of(path: Path) -> dict[str, float]:
    """Hinges and slides of an MJCF in its keyframe ``home`` [rad or m]; empty of what has none.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    source = prepare(path)
    if source.form != "mjcf" or source.root.find(f"keyframe/key[@name='{HOME}']") is None:
        return {}
    import mujoco

    with quiet():
        try:
            model = mujoco.MjSpec.from_string(source.text).compile()
        except (ValueError, mujoco.FatalError):  # whoever reads it says why
            return {}
    qpos = model.key(HOME).qpos
    single = [i for i in range(model.njnt) if model.jnt_type[i] >= mujoco.mjtJoint.mjJNT_SLIDE]
    return {model.joint(i).name: float(qpos[model.jnt_qposadr[i]]) for i in single}
