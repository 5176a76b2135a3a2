"""Model files: written, read, checked against descriptions, imported."""

from screwgauge.models.check import (
    check_file,
    check_models,
    check_table,
    home_poses,
    installed_readers,
    joint_transform,
)
from screwgauge.models.files.loops import loops_of, read_loops, write_loops
from screwgauge.models.files.urdf import write_urdf
from screwgauge.models.generate import model_texts, stem, write_models
from screwgauge.models.importing.model import Imported, Options, description, import_model, notes
from screwgauge.models.layout import CUTS, lay_out
from screwgauge.models.mjcf import PARTS, left_out, write_mjcf
from screwgauge.reference.left_out import BorneWeight

#: What a link of a URDF weighs, and a body of an MJCF, where any mass will do.
MATTER = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
INERTIAL = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'


def mjcf(body: str, further: str = "") -> str:
    return f"<mujoco>{further}<worldbody>{body}</worldbody></mujoco>"
