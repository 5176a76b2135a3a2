from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import screwgauge
from support.at_origin import opposite, replace_bracket
from support.models import write_models
from support.report import first_difference
from support.scene import sampled

pytestmark = pytest.mark.slow


@pytest.fixture(params=["3ups-upu-s", "3ups-upu-s-fast"])
def scene(request):
    return sampled(request.param, slice(0, 2000, 100))


def edited(scene, folder: Path, suffix: str, change) -> Path:
    write_models(scene.mechanism, folder, gravity=scene.applied.g)
    path = folder / f"{scene.mechanism.name}{suffix}"
    tree = ET.parse(path)
    change(tree.getroot())
    tree.write(path)
    return path


def found(results) -> tuple[int, str, set[str]]:
    row = first_difference(results)
    return results.exit_status, row["quantity"], {row["a"], row["b"]}


def swap_inertia(root) -> None:
    inertial = root.find(".//body[@name='leg2.lower']/inertial")
    xx, yy, zz, *rest = inertial.get("fullinertia").split()
    inertial.set("fullinertia", " ".join([zz, yy, xx, *rest]))


def flip_axis(root) -> None:
    axis = root.find("./joint[@name='leg3.q2']/axis")
    axis.set("xyz", " ".join(str(-float(value)) for value in axis.get("xyz").split()))


@pytest.mark.slow
def test_a_flipped_axis_in_the_urdf(scene, tmp_path):
    path = edited(scene, tmp_path, ".urdf", flip_axis)
    results = screwgauge.run(replace(scene, models={"pinocchio": path}))
    status, quantity, engines = found(results)
    assert (status, quantity) == (1, "joint_position")
    assert "pinocchio" in engines
    bad = results.errors[(results.errors["quantity"] == "joint_position") & ~results.errors["ok"]]
    assert set(bad["component"]) == {"leg3.q2"}


def no_gravity(root) -> None:
    root.find("./option").set("gravity", "0 0 0")


@pytest.mark.slow
@pytest.mark.parametrize("change", [swap_inertia, no_gravity])
def test_other_dynamics_in_the_mjcf_of_one_engine(change, scene, tmp_path):
    path = edited(scene, tmp_path, ".xml", change)
    status, quantity, engines = found(screwgauge.run(replace(scene, models={"mujoco": path})))
    assert (status, quantity) == (1, "tree_force")
    assert "mujoco" in engines


def shift_anchor(root) -> None:
    site = root.find(".//site[@name='leg2.wrist@child']")
    x, y, z = (float(value) for value in site.get("pos").split())
    site.set("pos", f"{x} {y} {z + 1e-6}")


@pytest.mark.slow
def test_a_closure_anchor_that_is_off_by_a_micrometre(scene, tmp_path):
    path = edited(scene, tmp_path, ".xml", shift_anchor)
    results = screwgauge.run(replace(scene, models={"mujoco": path}))
    assert found(results)[:2] == (1, "joint_position")
    closure = results.judge[(results.judge["residual"] == "loop_closure") & (results.judge["unit"] == "m")]
    worst = closure.set_index("engine").loc["mujoco"]
    assert worst["worst_component"].startswith("leg2.wrist")
    assert worst["max_abs"] == pytest.approx(1e-6, rel=0.5)


@pytest.mark.slow
def test_a_wrong_sign_in_the_lie_bracket(monkeypatch):
    """Only a fast motion reveals it: the paper's own case is nearly static."""
    replace_bracket(monkeypatch, opposite)
    results = screwgauge.run(sampled("3ups-upu-s-fast", slice(0, 2000, 100)))
    status, quantity, engines = found(results)
    assert (status, quantity) == (1, "joint_acceleration")
    assert "screw" in engines
    bad = results.judge[~results.judge["ok"]]
    assert set(bad["engine"]) == {"screw"}
    assert "loop_acceleration" in set(bad["residual"])


def test_the_first_row_of_the_bracket_as_printed(monkeypatch):
    """Eq. (36) as printed, with r the point at O."""

    def printed(first, second):
        w1, v1, w2, v2 = first[..., :3], first[..., 3:], second[..., :3], second[..., 3:]
        row = np.cross(w1, v2) - np.cross(w2, v1)
        return np.concatenate([row, row], axis=-1)

    replace_bracket(monkeypatch, printed)
    results = screwgauge.run(sampled("3ups-upu-s-fast", slice(0, 2000, 100)), engines=["screw"])
    assert results.exit_status == 1


def switch_off(root) -> None:
    root.find("./equality/connect[@name='s']").set("active", "false")


def turn_motor_round(root) -> None:
    root.find("./actuator/motor").set("gear", "-1")


@pytest.mark.slow
@pytest.mark.parametrize(("change", "said"), [(switch_off, "is disabled"), (turn_motor_round, "motor with gear 1")])
def test_a_constraint_or_a_motor_that_is_not_what_it_should_be_is_refused(scene, tmp_path, change, said):
    path = edited(scene, tmp_path, ".xml", change)
    with pytest.raises(screwgauge.ScrewgaugeError, match=said):
        screwgauge.run(replace(scene, models={"mujoco": path}), engines=["mujoco"])


@pytest.mark.slow
def test_a_loops_file_with_another_actuation_is_refused(scene, tmp_path):
    path = edited(scene, tmp_path, ".urdf", lambda root: None)
    loops = path.with_suffix(".loops.toml")
    head, _, tail = loops.read_text().rpartition("actuated = true\n")
    loops.write_text(head + tail)
    with pytest.raises(screwgauge.ScrewgaugeError, match=r"actuator_force.*'leg4'"):
        screwgauge.run(replace(scene, models={"pinocchio": path}), engines=["pinocchio"])
