"""The home pose that an MJCF names."""

from __future__ import annotations

from pathlib import Path

from screwgauge.models.readings.mujoco import heard, loaded
from screwgauge.models.readings.source import prepare

#: Keyframe that users of MJCF call so.
HOME = "home"
SINGLE = (2, 3)  # slide and hinge, by MuJoCo's numbers


def home_of(path: Path) -> dict[str, float]:
    """Hinges and slides of an MJCF in its keyframe ``home`` [rad or m]; empty of what has none.

    Raises:
        ScrewgaugeError: The file cannot be read.
    """
    source = prepare(path)
    if source.form != "mjcf" or source.root.find(f"keyframe/key[@name='{HOME}']") is None:
        return {}
    with heard():
        model = loaded(source)
    qpos = model.key(HOME).qpos
    single = [i for i in range(model.njnt) if int(model.jnt_type[i]) in SINGLE]
    return {model.joint(i).name: float(qpos[model.jnt_qposadr[i]]) for i in single}
