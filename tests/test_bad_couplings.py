import numpy as np
import pytest

import screwgauge
from screwgauge import ScrewgaugeError
from support.coupled import every_kind, geared_five_bar, moving
from support.engines import ask, model_files
from support.errors import DescriptionError, ModelFileError
from support.mechanism import Coupling, PolynomialSum, load_mechanism
from support.models import check_models, lay_out, read_loops, write_models
from support.readings import joint_equality
from support.scene import GIVEN
from support.tolerances import FORMULA

GEAR = geared_five_bar("left", "right", [0.0, 0.5])


def test_a_polynomial_that_is_not_finite():
    with pytest.raises(DescriptionError, match="not finite"):
        Coupling("gear", "a", PolynomialSum.of({"b": np.array([0.0, np.nan])}))


def test_a_name_that_an_mjcf_needs_for_a_closure(write):
    mechanism = load_mechanism(write("geared.toml", GEAR.replace("couplings.gear", "couplings.tip")))
    with pytest.raises(DescriptionError, match=r"the name 'tip' .* rename"):
        lay_out(mechanism, "minimal")


def test_powers_that_mujoco_does_not_have_are_its_own_failure(write, tmp_path):
    high = geared_five_bar("left", "right", [0.0, 0.5, 0.0, 0.0, 0.0, 0.2])
    scene = moving(write, high, {"left": 0.0}, "right.rod")
    results = screwgauge.run(scene, engines=["screw", "pinocchio", "mujoco"])
    said = "coupling 'gear': MuJoCo does not support powers above 4"
    assert said in results.failures["mujoco"].reason
    assert results.exit_status == 3
    assert (results.pairs["ok"] | results.pairs[["a", "b"]].isin(["mujoco"]).any(axis=1)).all()
    write_models(scene.mechanism, tmp_path)
    wrong = {(row.file, row.what) for row in check_models(scene.mechanism, tmp_path, readers=["mujoco"]) if not row.ok}
    assert wrong == {(f"geared-five-bar{cut}.xml", "coupling names") for cut in ("", "-full")}


def edited(folder, scene, engine: str, old: str, new: str):
    write_models(scene.mechanism, folder)
    files = model_files(scene.mechanism.name, engine, folder)
    file = files.loops if engine == "pinocchio" else files.model
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    return files


LACKING = {
    "mujoco": (' joint2="left" polycoef="0 0.5 0 0 0"', ' joint2="left" polycoef="0 0.505 0 0 0"'),
    "pinocchio": ("polynomial = [0, 0.5]", "polynomial = [0, 0.505]"),
}


@pytest.mark.parametrize("engine", LACKING)
def test_another_ratio_in_a_model_is_what_that_engine_moves_by(engine, write, tmp_path):
    scene = moving(write, GEAR, {"left": 0.0}, "right.rod")
    files = edited(tmp_path, scene, engine, *LACKING[engine])
    q = ask(engine, files, scene.problem(GIVEN)).values["joint_position"]
    assert q.pick(("right",)).array == pytest.approx(0.505 * q.pick(("left",)).array)
    rows = check_models(scene.mechanism, tmp_path, readers=["loops", "mujoco"])
    assert {row.what for row in rows if not row.ok} == {"coupling polynomial"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('<joint name="gear"', '<joint name="mesh"', "has no coupling 'gear'"),
        (
            '<joint name="gear"',
            '<joint name="other" joint1="right.elbow" /><joint name="gear"',
            "has an unknown coupling 'other'",
        ),
        ('<joint name="gear"', '<joint name="gear" active="false"', "disabled"),
        (' joint2="left" polycoef="0 0.5 0 0 0"', ' joint2="left" polycoef="1 0 0 0 0"', "does not depend on 'left'"),
    ],
)
def test_an_mjcf_with_other_joint_equalities_is_refused(old, new, said, write, tmp_path):
    scene = moving(write, GEAR, {"left": 0.0}, "right.rod")
    files = edited(tmp_path, scene, "mujoco", old, new)
    with pytest.raises(ScrewgaugeError, match=said):
        ask("mujoco", files, scene.problem(GIVEN))


def test_a_joint_equality_counts_from_the_references_of_its_joints():
    """What is read holds where MuJoCo's own residual is zero."""
    mujoco = pytest.importorskip("mujoco")
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    bodies = "".join(
        f'<body><joint name="{name}" type="slide" ref="{ref}"/>{inertial}</body>'
        for name, ref in (("a", 0.3), ("b", 2))
    )
    equality = '<joint name="tie" joint1="b" joint2="a" polycoef="0.1 0.5 0.7 -0.2 0.05"/>'
    text = f"<mujoco><worldbody>{bodies}</worldbody><equality>{equality}</equality></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    coupling = joint_equality(model, 0)
    assert (coupling.joint, coupling.function.lead) == ("b", "a")
    data = mujoco.MjData(model)
    for x in (-0.4, 0.3, 1.2):
        data.qpos[:] = x, np.polynomial.polynomial.polyval(x, coupling.function.polynomial)
        mujoco.mj_forward(model, data)
        assert abs(data.efc_pos[0]) < FORMULA


def test_a_loops_file_couples_coordinates_of_its_tree(write, tmp_path):
    scene = moving(write, GEAR, {"left": 0.0}, "right.rod")
    files = edited(tmp_path, scene, "pinocchio", 'coordinate = "right"\nof', 'coordinate = "tip"\nof')
    with pytest.raises(ModelFileError, match="unknown coordinate 'tip'"):
        read_loops(files.loops)


def test_every_kind_survives_its_files(write, tmp_path):
    mechanism = load_mechanism(write("every-kind.toml", every_kind()))
    write_models(mechanism, tmp_path)
    assert all(row.ok for row in check_models(mechanism, tmp_path))
