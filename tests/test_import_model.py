import numpy as np
import pinocchio as pin
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.geometry import Array

STATES = ("joint_position", "joint_velocity", "joint_acceleration")


def at(x: float, y: float, z: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def four_bar() -> tuple[pin.Model, list]:
    model = pin.Model()
    model.name = "linkage"
    lengths = {"a": (0, at(0, 0, 0), 0.2), "b": (1, at(0, 0, 0.2), 0.5), "c": (0, at(0.4, 0, 0), 0.4)}
    for name, (parent, place, length) in lengths.items():
        i = model.addJoint(parent, pin.JointModelRY(), place, name)
        rod = pin.Inertia(length, np.array([0, 0.01, length / 2]), length**3 / 12 * np.diag([1.0, 1.0, 0.1]))
        model.appendBodyToJoint(i, rod, pin.SE3.Identity())
    loop = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, model, 2, at(0, 0, 0.5), 3, at(0, 0, 0.4), pin.ReferenceFrame.LOCAL
    )
    return model, [loop]


def pose() -> Array:
    return np.array([-0.3, 1.2, 0.6])


def test_engines_agree_on_a_model_with_a_loop():
    model, loops = four_bar()
    scene = screwgauge.import_model(model, loops, q=pose(), independent=["a"], actuated=["a"])
    assert dict(scene.mechanism.independent) == {"a": "a"}
    results = screwgauge.run(scene, ("screw", "pinocchio", "mujoco"), ("actuator_force",))
    assert results.ok, results
    assert not results.failures


def test_the_open_tree_has_the_torques_of_pinocchio(tmp_path):
    model, _ = four_bar()
    model.armature = np.array([0.01, 0.02, 0.03])
    scene = screwgauge.import_model(model)
    results = screwgauge.run(scene, ("screw",), (*STATES, "generalized_force"))
    order, labels = (
        [results.components(name).index(joint) for joint in ("a", "b", "c")]
        for name in (STATES[0], "generalized_force")
    )
    q, v, a = (results.values(name, engine="screw")[:, order] for name in STATES)
    tau = results.values("generalized_force", engine="screw")[:, labels]
    model.gravity.linear = np.array([0, 0, -9.81])
    data = model.createData()
    expected = np.array([pin.rnea(model, data, *(x[k] for x in (q, v, a))) for k in range(len(q))])
    assert np.abs(tau - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("kind", ["PointAnchorConstraintModel", "FrameAnchorConstraintModel"])
def test_anchors_close_loops(kind):
    model, _ = four_bar()
    if not hasattr(pin, kind):
        pytest.skip("Pinocchio 3 has one class of constraints")
    anchor = getattr(pin, kind)(model, 2, at(0, 0, 0.5), 3, at(0, 0, 0.4))
    freedoms = {"PointAnchorConstraintModel": 1, "FrameAnchorConstraintModel": 0}[kind]
    if freedoms:
        assert len(screwgauge.import_model(model, [anchor], q=pose()).mechanism.independent) == freedoms
    else:
        with pytest.raises(ScrewgaugeError):
            screwgauge.import_model(model, [anchor], q=pose())


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda model, loops: ("four-bar.urdf", loops, None), "pinocchio.Model"),
        (lambda model, loops: (model, ["loop"], None), "constraint"),
        (lambda model, loops: (model, loops, [0.0]), "3 finite numbers"),
        (lambda model, loops: (model, loops, [0.0, np.nan, 0.0]), "3 finite numbers"),
    ],
)
def test_what_is_no_model_is_refused(change, word):
    model, loops, q = change(*four_bar())
    with pytest.raises(ScrewgaugeError, match=word):
        screwgauge.import_model(model, loops, q=q)
