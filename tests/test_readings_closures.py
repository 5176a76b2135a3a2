import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from support.data import data
from support.geometry import Array
from support.mechanism import GROUND
from support.readings import ClosureReading, Reading, read

READ = 1e-13
MATTER = '<inertial pos="0.1 0 0.2" mass="1" diaginertia="1 2 2"/>'
#: Two arms of two links with a bracket fixed to one, none of them straight; the joints' references are not zero.
ARMS = data("two-arms.xml")
JOINTS = {"a1": 0.7, "b1": 0.2, "c1": -0.5, "d1": 0.3}
FORMS = {
    "anchor": '<connect name="e" body1="b" body2="d" anchor="0.1 0.2 0.3"/>',
    "anchor in the world": '<connect name="e" body1="d" anchor="0.1 0.2 0.3"/>',
    "on a fixed body": '<connect name="e" body1="bracket" body2="c" anchor="0.1 0 0.3"/>',
    "points by sites": '<connect name="e" site1="sb" site2="sd"/>',
    "a site of the world": '<connect name="e" site1="w" site2="sk"/>',
    "weld": '<weld name="e" body1="b" body2="d"/>',
    "weld with anchor": '<weld name="e" body1="c" body2="b" anchor="0.2 0.1 0"/>',
    "relpose and anchor": '<weld name="e" body1="b" body2="d" relpose="0.1 0.2 0.3 0.5 0.5 -0.5 0.5" anchor="1 0 0"/>',
    "welded sites": '<weld name="e" site1="sk" site2="sd"/>',
    "weld to the world": '<weld name="e" body1="a" relpose="0 1 0 0.6 0.8 0 0"/>',
}


def world(reading: Reading, body: str, frame: Array) -> Array:
    return frame if body == GROUND else reading.bodies[body].pose @ frame


def sides(reading: Reading, closure: ClosureReading) -> tuple[Array, Array]:
    return world(reading, closure.first, closure.first_frame), world(reading, closure.second, closure.second_frame)


def residual(path: Path) -> Array:
    """Return MuJoCo's constraint error at `JOINTS`: metres, and half the angle of a weld."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for name, value in JOINTS.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_fwdPosition(model, data)
    return data.efc_pos[: data.ne].copy()


@pytest.mark.parametrize("form", FORMS)
def test_closures_are_open_by_what_mujoco_says(form, write):
    path = write("arms.xml", ARMS.replace("@", FORMS[form]))
    reading = read(path, "mujoco", home=JOINTS)
    (closure,) = reading.closures.values()
    T1, T2 = sides(reading, closure)
    error = residual(path)
    assert closure.kind == ("weld" if len(error) == 6 else "point")
    np.testing.assert_allclose(T1[:3, 3] - T2[:3, 3], error[:3], rtol=0, atol=READ)
    if closure.kind == "weld":
        R = T2[:3, :3].T @ T1[:3, :3]
        half = np.sqrt((3.0 - np.trace(R)) / 4.0)  # sine of half the angle
        assert half == pytest.approx(np.linalg.norm(error[3:]), rel=1e-12, abs=0)
        assert half > 0.1


def test_pinocchio_reads_the_same_closures_but_for_some_anchors(write):
    """One tree, without references: those it takes otherwise. An anchor in a body that is fixed to another one it takes
    for one in that, and beside a relpose it is placed otherwise.
    """
    forms = {name: row.replace('"e"', f'"{name}"') for name, row in FORMS.items()}
    text = re.sub(' ref="[^"]*"', "", ARMS.replace("@", "".join(forms.values())))
    text = re.sub(r'</body>\s*<body name="c"', '<body name="c"', text).replace("</worldbody>", "</body></worldbody>")
    path = write("arms.xml", text)
    one, other = (read(path, library, home=JOINTS) for library in ("mujoco", "pinocchio"))
    assert set(one.closures) == set(FORMS)
    assert set(one.closures) - set(other.closures) == {"a site of the world"}
    different = set()
    for name, said in other.closures.items():
        want = one.closures[name]
        assert (said.kind, said.first, said.second) == (want.kind, want.first, want.second)
        gaps = [np.linalg.inv(T1) @ T2 for T1, T2 in (sides(one, want), sides(other, said))]
        apart = np.abs(gaps[0] - gaps[1]).max()
        if said.kind == "point":  # the axes of which mean nothing
            apart = abs(np.linalg.norm(gaps[0][:3, 3]) - np.linalg.norm(gaps[1][:3, 3]))
        different |= {name} if apart > READ else set()
    assert different == {"on a fixed body", "relpose and anchor"}


def test_closures_that_crash_pinocchio_are_not_shown_to_it_and_said(write):
    rows = FORMS["anchor"] + FORMS["a site of the world"].replace('"e"', '"g"') + '<weld name="f" body1="a" body2="b"/>'
    reading = read(write("arms.xml", ARMS.replace("@", rows)), "pinocchio")
    assert list(reading.closures) == ["f"]
    said = ["connect e: Pinocchio cannot place d", "connect g: Pinocchio cannot place w"]
    assert [phrase for phrase in reading.ignored if "cannot place" in phrase] == said


def test_closures_keep_their_names_and_those_without_get_one(write):
    rows = FORMS["anchor"].replace('"e"', '"z"') + FORMS["weld"].replace('"e"', '"m"') + FORMS["anchor"]
    rows += '<connect body1="b" body2="d" anchor="0 0 0"/>'
    reading = read(write("arms.xml", ARMS.replace("@", rows)), "mujoco")
    assert {name: closure.kind for name, closure in reading.closures.items()} == {
        "z": "point",
        "m": "weld",
        "e": "point",
        "connect_4": "point",
    }


@pytest.mark.parametrize(
    ("row", "of", "value"),
    [
        ('joint1="d1" joint2="a1" polycoef="0.1 2 0.5 -0.3 0.7"', "a1", None),
        ('joint1="d1" joint2="c1" polycoef="0 1 0 0 0"', "c1", None),
        ('joint1="d1" polycoef="0.1 0 0 0 0"', "", 0.3),
    ],
)
def test_a_coupling_is_a_polynomial_of_coordinates_as_they_count(row, of, value, write):
    path = write("arms.xml", ARMS.replace("@", f"<joint name='k' {row}/>"))
    said = read(path, "mujoco").couplings["k"]
    assert (said.joint, said.function.lead) == ("d1", of)
    x = JOINTS[of] if of else 0.0
    (error,) = residual(path)
    assert JOINTS["d1"] - np.polynomial.polynomial.polyval(x, said.function.polynomial) == pytest.approx(
        error, rel=0, abs=READ
    )
    if value is not None:
        assert said.function.polynomial == pytest.approx([value], rel=1e-15, abs=0)


def test_what_is_not_active_is_no_closure_and_said(write):
    rows = FORMS["anchor"].replace("/>", ' active="false"/>')
    reading = read(write("arms.xml", ARMS.replace("@", rows)), "mujoco")
    assert (reading.closures, "equality e, which is not active" in reading.ignored) == ({}, True)


#: Names of joints -> their coefficients, tendon by tendon; the polynomial; who follows whom, none where it is no
#: coupling.
TENDONS = {
    "one": ([{"a1": 0.5}], "0.3 0 0 0 0", ("a1",)),
    "sum of two": ([{"a1": 0.5, "c1": -2.0}], "0.3 0 0 0 0", ("c1", "a1")),
    "two of one each": ([{"d1": 0.5}, {"a1": 2.0}], "0.1 2 0.5 -0.3 0.7", ("d1", "a1")),
    "two of the same two": ([{"a1": 0.5, "c1": 1.0}, {"c1": 3.0, "a1": 1.0}], "0.1 2 0 0 0", ("c1", "a1")),
    "a joint that cancels": ([{"a1": 1.0, "b1": 1.0}, {"b1": 0.5, "c1": 1.0}], "0 2 0 0 0", ("c1", "a1")),
    "three": ([{"a1": 0.5, "b1": 1.0, "c1": -2.0}], "0.4 0 0 0 0", ("a1", "b1", "c1")),
    "two against two": ([{"a1": 0.5, "b1": 1.0}, {"b1": 3.0, "c1": 1.0}], "0.1 2 0 0 0", ("a1", "b1", "c1")),
    "two, by powers": ([{"a1": 0.5, "c1": 1.0}, {"d1": 2.0}], "0.1 1 1 0 0", ("a1", "d1", "c1")),
    "two, by powers of one of them": ([{"a1": 0.5, "d1": 1.0}, {"d1": 2.0}], "0.1 1 1 0 0", ("a1", "d1")),
    "powers of two": ([{"a1": 0.5}, {"d1": 1.0, "c1": 1.0}], "0 1 1 0 0", ()),
    "what cancels": ([{"a1": 0.5}, {"a1": 1.0}], "0.1 0.5 0 0 0", ()),
}


@pytest.mark.parametrize("case", TENDONS)
def test_tendons_that_are_equal_couple_their_joints(case, write):
    tendons, powers, named = TENDONS[case]
    rows = ["".join(f'<joint joint="{joint}" coef="{coef}"/>' for joint, coef in tendon.items()) for tendon in tendons]
    said = "".join(f'<fixed name="t{i + 1}">{row}</fixed>' for i, row in enumerate(rows))
    names = " ".join(f'tendon{i + 1}="t{i + 1}"' for i in range(len(rows)))
    text = ARMS.replace("@", f'<tendon name="e" {names} polycoef="{powers}"/>')
    path = write("arms.xml", text.replace("<equality>", f"<tendon>{said}</tendon><equality>"))
    reading = read(path, "mujoco")
    assert any("equality e, which" in phrase for phrase in reading.ignored) != bool(named)
    if not named:
        assert reading.couplings == {}
        return
    coupling = reading.couplings["e"]
    assert coupling.named == named
    # the error of the tendons is that of the coupling times what its joint moves them by
    (error,) = residual(path)
    first, second, p = tendons[0], tendons[1] if len(tendons) > 1 else {}, [float(word) for word in powers.split()]
    by = first.get(coupling.joint, 0.0) - p[1] * second.get(coupling.joint, 0.0)
    gap = JOINTS[coupling.joint] - coupling.function(JOINTS)
    assert by * gap == pytest.approx(error, rel=0, abs=READ)


def test_a_tendon_that_couples_and_pulls_is_said_to_pull(write):
    joints = "".join(f'<joint joint="{name}" coef="1"/>' for name in ("a1", "c1"))
    tendon = f'<tendon><fixed name="t" stiffness="3">{joints}</fixed></tendon>'
    text = ARMS.replace("@", '<tendon name="e" tendon1="t"/>').replace("<equality>", f"{tendon}<equality>")
    reading = read(write("arms.xml", text), "mujoco")
    assert list(reading.couplings) == ["e"]
    assert "fixed tendon t" in reading.ignored
