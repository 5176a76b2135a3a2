"""Public humanoids on both feet: torques of all actuated joints, and forces of contacts, in three engines."""

import pytest
from campaigns.public import installed

import screwgauge
from screwgauge.models.importing.model import Options, import_model
from support.judging import agreed
from support.stance import unbalanced

ENGINES = ("screw", "pinocchio", "mujoco")
#: Robot -> its file, joints of the left leg from the hip down and where they stand [rad], and its left foot.
HUMANOIDS = {
    "g1": (
        "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        [f"left_{name}_joint" for name in ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")],
        (-0.4, 0.0, 0.0, 0.8, -0.4, 0.0),
        "left_ankle_roll_link",
    ),
    "talos": (
        "talos_data/robots/talos_reduced.urdf",
        [f"leg_left_{k}_joint" for k in range(1, 7)],
        (0.0, 0.0, -0.4, 0.8, -0.4, 0.0),
        "leg_left_6_link",
    ),
}


@pytest.mark.campaign
@pytest.mark.parametrize("name", HUMANOIDS)
def test_humanoid_stands_on_both_feet(name, tmp_path):
    file, joints, stance, foot = HUMANOIDS[name]
    file = installed("example-robot-data", file)
    mechanism = import_model(file, Options(floating=True)).mechanism
    leg = dict(zip(joints, stance, strict=True))
    other = {joint.replace("left", "right"): at for joint, at in leg.items()}
    base = {name for joint in mechanism.joints if not joint.constrains for name in joint.coordinates}
    lines = [f'mechanism = "{file}"', "floating = true", "time = { duration = 1, step = 0.1 }"]
    for i, (label, coordinate) in enumerate(mechanism.independent.items()):
        if label in leg or (label not in other and coordinate not in base):
            at = leg.get(label, mechanism.home[mechanism.coordinates.index(coordinate)])
            low, high = mechanism.limits[mechanism.coordinates.index(coordinate)]
            swing = min(0.08, 0.5 * (high - at), 0.5 * (at - low))
            lines.append(f'motion."{label}" = {{ offset = {at}, harmonics = [[{2 + 0.2 * i}, 0, {swing}]] }}')
    lines += [f'stance."{label}" = {x}' for label, x in other.items()]
    feet = [foot, foot.replace("left", "right")]
    lines += [f'[[contacts]]\nbody = "{foot}"\nkind = "weld"\npoint = [0.03, 0, -0.03]' for foot in feet]
    (tmp_path / "stand.toml").write_text("\n".join(lines) + "\n")
    scene = screwgauge.load_scene(tmp_path / "stand.toml")
    results = agreed(screwgauge.run(scene, engines=ENGINES))
    assert (results.errors[results.errors["quantity"] == "actuator_force"]["max_scaled"] < 1e-11).all()
    assert len(results.components("actuator_force")) == len(mechanism.actuators)
    for engine in ENGINES:
        assert unbalanced(scene, results, engine, [f"{foot}.contact" for foot in feet]) < 1e-12
