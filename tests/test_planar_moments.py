from pathlib import Path

import numpy as np
import pytest

import screwgauge
from screwgauge.reference.planar import normals_of_planes
from support import urdf
from support.data import DATA
from support.errors import DescriptionError
from support.mechanism import load_mechanism
from support.models import import_model

G = 9.81

#: A five-bar of a textbook: pivots 0.3 m apart, cranks of 0.2 m, couplers of 0.35 m, in the plane x-z, which turns.
BASE, CRANK, ROD = 0.3, 0.2, 0.35
MASSES = {"left": (0.4, 0.09, 2e-3), "right": (0.5, 0.11, 3e-3), "near": (0.3, 0.16, 4e-3), "far": (0.35, 0.19, 5e-3)}


def five_bar(moment: str, plane: str = "") -> str:
    bodies = "".join(
        f"[bodies.{name}]\nmass = {m}\ncom = [{c}, 0, 0]\ninertia = {moment.format(J=J, half=J / 3)}\n"
        for name, (m, c, J) in MASSES.items()
    )
    joints = (
        ("a", "ground", "left", "0", None),
        ("b", "ground", "right", BASE, None),
        ("c", "left", "near", CRANK, None),
        ("d", "right", "far", CRANK, None),
        ("e", "near", "far", ROD, ROD),
    )
    text = 'name = "five-bar"\n[independent]\na = "a"\nb = "b"\n' + bodies
    for name, parent, child, at, on in joints:
        text += f'[joints.{name}]\nkind = "R"\nparent = "{parent}"\nchild = "{child}"\naxes = [[0, -1, 0]]\n'
        text += f"parent_frame.position = [{at}, 0, 0]\n" + (f"child_frame.position = [{on}, 0, 0]\n" if on else "")
        text += "actuated = true\n" if parent == "ground" else ""
        text += f"home = [{HOME[name]}]\n" + plane
    return text


HOME = {"a": 2.0, "b": 1.1, "c": -1.0, "d": 1.0, "e": 0.0}
MOTION = 'mechanism = "five-bar.toml"\ntime = { duration = 1, step = 0.05 }\n'
MOTION += (
    "motion.a = { offset = 2.0, harmonics = [[5, 0, 0.3]] }\nmotion.b = { offset = 1.1, harmonics = [[7, 0, 0.2]] }\n"
)


def torques(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Virtual work in complex numbers. (2,) -> (2,)."""
    hips = np.array([0.0, BASE])
    elbows = hips + CRANK * np.exp(1j * q)
    gap = elbows[1] - elbows[0]
    lean = np.arccos(abs(gap) / (2.0 * ROD))
    phi = np.angle(gap) + np.array([lean, np.pi - lean])  # of the rods: they meet above
    rods, cranks = 1j * ROD * np.exp(1j * phi), 1j * CRANK * np.exp(1j * q)

    def rates(of_cranks: np.ndarray, left_over: complex = 0.0) -> np.ndarray:
        """Solve ``rods . w = cranks . rates``."""
        gap_rate = of_cranks[1] - of_cranks[0] + left_over
        A = np.array([[rods[0].real, -rods[1].real], [rods[0].imag, -rods[1].imag]])
        return np.linalg.solve(A, [gap_rate.real, gap_rate.imag])

    w = rates(cranks * v)
    turned = -CRANK * np.exp(1j * q) * v**2
    spun = -ROD * np.exp(1j * phi) * w**2
    alpha = rates(cranks * a + turned, spun[1] - spun[0])
    total = np.zeros(2)
    for k in range(2):
        unit = np.eye(2)[k]
        w_unit = rates(cranks * unit)
        for i, (crank, rod) in enumerate((("left", "near"), ("right", "far"))):
            m, c, J = MASSES[crank]
            speed, acceleration = 1j * c * np.exp(1j * q[i]) * unit[i], c * np.exp(1j * q[i]) * (1j * a[i] - v[i] ** 2)
            total[k] += m * np.real(np.conj(speed) * (acceleration + 1j * G)) + J * a[i] * unit[i]
            m, c, J = MASSES[rod]
            speed = cranks[i] * unit[i] + 1j * c * np.exp(1j * phi[i]) * w_unit[i]
            acceleration = cranks[i] * a[i] + turned[i] + c * np.exp(1j * phi[i]) * (1j * alpha[i] - w[i] ** 2)
            total[k] += m * np.real(np.conj(speed) * (acceleration + 1j * G)) + J * alpha[i] * w_unit[i]
    return total


def moved(folder: Path, text: str) -> screwgauge.Results:
    (folder / "five-bar.toml").write_text(text, encoding="utf-8")
    (folder / "move.toml").write_text(MOTION, encoding="utf-8")
    return screwgauge.run(screwgauge.load_scene(folder / "move.toml"))


def test_a_four_bar_with_one_moment_a_link_moves_as_its_energy_equation_says():
    results = screwgauge.run(screwgauge.load_scene(DATA / "loops-planar-sim.toml"))
    assert results.ok
    for engine in ("screw", "pinocchio", "mujoco"):
        angle = results.values("observable", engine=engine)[1:, 0]
        # quadrature of the energy equation, apart from this package
        assert angle == pytest.approx([3.4431249427787, 7.2242830141557, 8.0563859564061], rel=1e-9, abs=0)
    (said,) = [one for one in results.warnings if "moment of inertia" in one]
    assert all(name in said for name in ("crank", "coupler", "rocker"))


def test_a_five_bar_with_one_moment_a_link_needs_the_torques_of_the_textbook(tmp_path):
    results = moved(tmp_path, five_bar("{{ yy = {J} }}"))
    assert results.ok
    motion = results.scene.motion
    expected = np.array([torques(*state) for state in zip(motion.y, motion.yd, motion.ydd, strict=True)])
    assert np.abs(results.values("actuator_force", engine="screw") - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("moment", ["{{ yy = {J} }}", "{{ yy = {J}, xx = {half} }}"], ids=["alone", "with another"])
def test_what_is_completed_has_no_effect(moment, tmp_path):
    results = [moved(tmp_path, five_bar(each)) for each in (moment, "{{ yy = {J}, xx = {J}, zz = {half} }}")]
    for quantity in ("actuator_force", "generalized_force", "reaction"):
        one, other = (each.values(quantity, engine="pinocchio") for each in results)
        assert np.abs(one - other).max() < 1e-12 * np.abs(other).max()


def arm(*joints: str, moment: str = "{ zz = 0.1 }") -> str:
    text = 'name = "arm"\n[independent]\n' + "".join(
        f'q{i} = "j{i}"\n' for i, each in enumerate(joints) if "#" not in each
    )
    near = "ground"
    for i, joint in enumerate(joints):
        text += f"[bodies.b{i}]\nmass = 1\ncom = [0.1, 0, 0]\ninertia = {moment}\n"
        text += f'[joints.j{i}]\nparent = "{near}"\nchild = "b{i}"\nparent_frame.position = [0.2, 0, 0]\n{joint}\n'
        near = f"b{i}"
    return text


Z, Y = 'kind = "R"\naxes = [[0, 0, 1]]', 'kind = "R"\naxes = [[0, 1, 0]]'
SLIDE, NEARLY = 'kind = "P"\naxes = [[0, 0.6, 0.8]]', 'kind = "R"\naxes = [[0, 4e-6, "sqrt(1-16e-12)"]]'
HELD = '#\nkind = "R"\naxes = [[0, 1, 0]]\nhome = ["pi/2"]'
TURNED = 'kind = "R"\naxes = [[1, 0, 0]]\nparent_frame.rotation = { axis = [0, 1, 0], angle = "-pi/2" }\n'
TURNED += 'child_frame.rotation = { axis = [0, 1, 0], angle = "-pi/2" }'


@pytest.mark.parametrize(
    "joints", [(Z, Z), (Z, SLIDE, Z), (SLIDE, SLIDE), (Z, TURNED)], ids=["RR", "RPR", "PP", "frames"]
)
def test_chains_whose_bodies_turn_about_one_direction_are_completed(joints, write):
    mechanism = load_mechanism(write("arm.toml", arm(*joints)))
    for body in mechanism.bodies:
        assert body.inertia[2, 2] == 0.1
        assert np.linalg.eigvalsh(body.inertia) == pytest.approx([0.05, 0.05, 0.1], rel=1e-15, abs=0)
    assert "b0" in " ".join(mechanism.remarks)


def test_a_joint_that_a_coupling_holds_turns_nothing(write):
    held = '[couplings.c]\ncoordinate = "j1"\npolynomial = ["pi/2"]\n'
    text = arm(Z, HELD, moment="{ xx = 0.1, zz = 0.1, yy = 0.2 }") + held
    mechanism = load_mechanism(write("arm.toml", text.replace("{ xx = 0.1, zz = 0.1, yy = 0.2 }", "{ zz = 0.1 }", 1)))
    directions = normals_of_planes(mechanism.joints, mechanism.couplings)
    assert np.abs(directions["b1"]) == pytest.approx(np.array([[1.0, 0.0, 0.0]]), abs=1e-15)
    free = load_mechanism(write("free.toml", arm(Z, Y, moment="{ xx = 0.1, yy = 0.1, zz = 0.1 }")))
    assert "b1" not in normals_of_planes(free.joints, free.couplings)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (arm(Z, Y), "more than one axis"),
        (arm(Z, NEARLY), "components in full"),
        (arm(Y), r"only about its axis \[0\.0, 1\.0, 0\.0\]"),
        (arm('kind = "U"\naxes = [[1, 0, 0], [0, 0, 1]]').replace('"j0"', '"j0.q1"'), "more than one axis"),
        (arm(Z, moment="{ xx = 0.1, yy = 0.5, zz = 0.1 }"), "only the moment about"),
        (arm(Z, moment="{ xx = 0.1 }"), r"only about its axis \[0\.0, 0\.0, 1\.0\]"),
        (arm(Z, moment="{ zz = 0.1, xx = 0.5, xz = 1e-3, yy = 0.01 }"), "violate the triangle inequality"),
    ],
    ids=[
        "in space",
        "all but parallel",
        "about another axis",
        "universal",
        "wrong across it",
        "none about it",
        "with products",
    ],
)
def test_a_moment_that_is_not_enough_is_refused_with_what_to_do(text, reason, write):
    with pytest.raises(DescriptionError, match=reason) as refused:
        load_mechanism(write("arm.toml", text))
    assert "triangle inequality" in str(refused.value)


def test_links_of_a_file_with_one_moment_are_completed(write):
    bars = [urdf.link(name, 1, (0, 0, 0.1), com=".1 0 0") for name in "ab"]
    hinges = [urdf.joint(name, "continuous", *ends, axis="0 0 1") for name, ends in (("j", ("base", "a")), ("k", "ab"))]
    path = write("planar.urdf", urdf.robot(urdf.link("base"), *bars, *hinges))
    imported = import_model(path)
    assert np.diag(imported.mechanism.body("b").inertia).tolist() == [0.05, 0.05, 0.1]
    assert any("a, b, which turn about one direction" in each for each in imported.remarks)


@pytest.mark.parametrize("across", ["xx = 0.02", "xx = 0.03, yy = 0.05", "xx = 1e-6, yy = 0.01, xy = 5e-5"])
def test_moments_across_the_direction_may_be_too_small(across, write):
    mechanism = load_mechanism(write("arm.toml", arm(Z, Z, moment=f"{{ zz = 0.1, {across} }}")))
    for body in mechanism.bodies:
        assert body.inertia[2].tolist() == [0.0, 0.0, 0.1]
        assert body.inertia[0, 0] + body.inertia[1, 1] == pytest.approx(0.1, rel=1e-15, abs=0)


def test_all_bodies_that_are_refused_are_named_at_once(write):
    with pytest.raises(DescriptionError, match=r'allow = \["b0.triangle", "b1.triangle"\]'):
        load_mechanism(write("arm.toml", arm(Y, Z)))
