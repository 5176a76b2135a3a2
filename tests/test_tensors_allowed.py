import json

import numpy as np
import pytest

import screwgauge
from support.data import data
from support.errors import DescriptionError
from support.mechanism import load_mechanism
from support.models import Options, check_models, description, import_model, write_models
from support.scene import load_scene

#: Moments of the hand exceed the sum by 4e-4 kg m^2, an eighth.
EXCESS = 4e-4
ARM = data("two-hinges.toml")
ALLOW = 'allow = ["hand.triangle"]\n'
SCENE = """time = { duration = 0.5, step = 0.1 }
motion.a.harmonics = [[5, 0, 0.6]]
motion.b.harmonics = [[6, 0, 0.8]]
"""
URDF = data("two-hinges.urdf")


def torques(y: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Euler's equations written out. Shapes (2,) -> (2,)."""
    z, g = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 9.81])
    c, s = np.cos(y), np.sin(y)
    Ra = np.array([[c[0], -s[0], 0], [s[0], c[0], 0], [0, 0, 1]])
    R = Ra @ np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    e = Ra[:, 1]
    w, dw = v[0] * z + v[1] * e, a[0] * z + a[1] * e + v[0] * v[1] * np.cross(z, e)
    I = R @ np.array([[1e-3, 2e-4, 0], [2e-4, 2e-3, 0], [0, 0, 3.4e-3]]) @ R.T
    elbow, arm, own = 0.4 * Ra[:, 0], 0.2 * Ra[:, 0], R @ np.array([0.1, 0.05, 0.02])

    def turned(r: np.ndarray, spin: np.ndarray, growth: np.ndarray) -> np.ndarray:
        return np.cross(growth, r) + np.cross(spin, np.cross(spin, r))

    force = 0.7 * (turned(elbow, v[0] * z, a[0] * z) + turned(own, w, dw) + g)
    moment = I @ dw + np.cross(w, I @ w) + np.cross(own, force)
    upper = 2e-2 * a[0] + z @ np.cross(arm, turned(arm, v[0] * z, a[0] * z) + g)
    return np.array([upper + z @ (moment + np.cross(elbow, force)), e @ moment])


def check(results: screwgauge.Results) -> None:
    assert results.ok
    motion = results.scene.motion
    expected = np.array([torques(*state) for state in zip(motion.y, motion.yd, motion.ydd, strict=True)])
    for engine in ("screw", "pinocchio", "mujoco"):
        found = results.values("actuator_force", engine=engine)
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
    (said,) = [one for one in results.warnings if "llowed" in one]
    assert "hand" in said
    assert f"{EXCESS:.3g}" in said


def test_without_leave_it_is_refused_with_what_to_write(write):
    with pytest.raises(DescriptionError, match="triangle inequality") as refused:
        load_mechanism(write("arm.toml", ARM))
    assert ALLOW.strip() in str(refused.value)


def test_a_description_may_allow_it(write):
    write("arm.toml", ALLOW + ARM)
    check(screwgauge.run(load_scene(write("move.toml", f'mechanism = "arm.toml"\n{SCENE}'))))


@pytest.mark.parametrize("file", ["arm.toml", "arm.urdf"])
def test_a_scene_may_allow_it(file, write):
    write("arm.toml", ARM)
    write("arm.urdf", URDF)
    results = screwgauge.run(load_scene(write("move.toml", f'mechanism = "{file}"\n{ALLOW}{SCENE}')))
    if file == "arm.toml":
        check(results)
    assert results.ok
    assert not [one for one in results.warnings if "admits nothing" in one]


def test_truth_takes_it_too(write):
    pytest.importorskip("flint")
    write("arm.toml", ALLOW + ARM)
    scene = load_scene(write("move.toml", f'mechanism = "arm.toml"\n{SCENE}')).at([0.2])
    assert screwgauge.run(scene, engines=["screw", "truth"], quantities=["actuator_force"]).ok


def test_import_takes_it_where_allow_says_so(write, tmp_path, command):
    path = write("arm.urdf", URDF)
    assert "hand.triangle" in command("import", path, "-o", tmp_path / "out.toml", status=2).err
    said = command("import", path, "-o", tmp_path / "out.toml", "--allow", "hand.triangle").out
    assert f"{EXCESS:.3g}" in said
    assert load_mechanism(tmp_path / "out.toml").body("hand").inertia[2, 2] == 3.4e-3
    assert ALLOW in (tmp_path / "out.toml").read_text(encoding="utf-8")


def test_run_takes_a_model_file_where_allow_says_so(write, inside, command):
    path, more = write("arm.urdf", URDF), ("--quantities", "actuator_force")
    assert "hand.triangle" in command("run", path, *more, status=2).err
    assert "AGREE" in command("run", path, *more, "--allow", "hand.triangle").out
    plain = write("plain.toml", ALLOW + ARM)
    assert "model files" in command("run", plain, *more, "--allow", "hand.triangle", status=2).err


def test_what_was_allowed_is_written(write):
    mechanism = import_model(write("arm.urdf", URDF), Options(allow=["hand.triangle"])).mechanism
    again = load_mechanism(write("again.toml", description(mechanism)))
    assert np.array_equal(again.body("hand").inertia, mechanism.body("hand").inertia)


def test_model_files_have_the_tensor_as_our_readers_read_them(write, tmp_path):
    mechanism = load_mechanism(write("arm.toml", ALLOW + ARM))
    write_models(mechanism, tmp_path)
    rows = check_models(mechanism, tmp_path)
    assert [row for row in rows if row.what == "inertia tensor"]
    assert all(row.ok for row in rows)


@pytest.mark.parametrize(
    ("allow", "reason"),
    [
        (["nobody.triangle"], "unknown body 'nobody'"),
        (["hand.inertia"], "unknown property 'inertia'"),
        ("hand.triangle", "not a list"),
    ],
)
def test_leave_for_what_is_not_there_is_refused(allow, reason, write):
    with pytest.raises(screwgauge.ScrewgaugeError, match=reason):
        load_mechanism(write("arm.toml", f"allow = {json.dumps(allow)}\n{ARM}"))


def test_leave_that_admits_nothing_is_named(write):
    fine = ARM.replace("3.4e-3", "2.9e-3")
    assert "hand.triangle" in " ".join(load_mechanism(write("arm.toml", ALLOW + fine)).remarks)


def test_negative_moments_are_no_matter_of_leave(write):
    with pytest.raises(DescriptionError, match="not positive semidefinite"):
        load_mechanism(write("arm.toml", ALLOW + ARM.replace("xy = 2e-4", "xy = 2e-2")))
