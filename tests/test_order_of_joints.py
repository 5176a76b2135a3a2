import numpy as np
import pytest

from screwgauge import diagnose
from support.diagnosis import STATES, summary
from support.mechanics import inverse_dynamics, with_gravity
from support.readings import by_name, draw, in_file, prepare, read, tree_of
from support.urdf import joint as hinge
from support.urdf import link, robot

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = (("hip", "1 0 0", (0.2, 0.1, 0)), ("thigh", "0 1 0", (0, 0.05, 0)), ("calf", "0 1 0", (0, 0, -0.2)))


def quadruped(legs=LEGS, mount: str = "") -> tuple[str, str]:
    """As URDF and MJCF. `mount` names fixed joints on which legs hang, as in public models."""
    urdf, mjcf = [link("trunk")], []
    for k, leg in enumerate(legs):
        near, body = "trunk", ""
        if mount:
            near = f"{leg}.mount"
            urdf += [link(near), hinge(mount.format(leg=leg, k=k), "fixed", "trunk", near)]
        for i, (joint, axis, at) in enumerate(JOINTS):
            signs = (1 if leg[0] == "F" else -1, 1 if leg[1] == "L" else -1, 1)
            xyz = " ".join(str(sign * x) for sign, x in zip(signs, at, strict=True))
            name, mass, com = f"{leg}_{joint}", 1.5 - 0.4 * i, f"0.01 0.0{i} -0.1"
            urdf.append(link(f"{name}.link", mass, (0.01, 0.01, 0.002), com))
            urdf.append(hinge(name, "revolute", near, f"{name}.link", xyz=xyz, axis=axis, limits=(-1, 1)))
            body += (
                f'<body name="{name}.link" pos="{xyz}"><joint name="{name}" axis="{axis}" range="-1 1"/>'
                f'<inertial pos="{com}" mass="{mass}" diaginertia="0.01 0.01 0.002"/>'
            )
            near = f"{name}.link"
        mjcf.append(body + "</body>" * len(JOINTS))
    return (
        robot(*urdf, name="quad"),
        '<mujoco model="quad"><compiler angle="radian" autolimits="true"/><worldbody><body name="trunk">'
        f"{''.join(mjcf)}</body></worldbody></mujoco>",
    )


@pytest.fixture
def files(write):
    urdf, mjcf = quadruped()
    return write("quad.urdf", urdf), write("quad.xml", mjcf)


@pytest.mark.parametrize("mount", ["", "{leg}_mount", "m{k}"])
def test_the_two_orders_are_those_of_the_libraries(mount, write):
    urdf, mjcf = (write(name, text) for name, text in zip(("q.urdf", "q.xml"), quadruped(mount=mount), strict=True))
    pinocchio, mujoco = (read(urdf, library) for library in ("pinocchio", "mujoco"))
    assert by_name(prepare(urdf)) == tuple(pinocchio.joints)
    assert in_file(prepare(urdf)) == tuple(mujoco.joints)
    assert in_file(prepare(mjcf)) == tuple(read(mjcf, "mujoco").joints) == tuple(read(mjcf, "pinocchio").joints)
    assert by_name(prepare(mjcf))[:3] == ("FL_hip", "FL_thigh", "FL_calf")


def test_chains_are_followed_to_their_end(write):
    links = [link(f"l{i}") for i in range(1501)]
    joints = [hinge(f"j{i}", "revolute", f"l{i}", f"l{i + 1}") for i in range(1500)]
    source = prepare(write("long.urdf", robot(*links, *joints)))
    assert by_name(source) == in_file(source) == tuple(f"j{i}" for i in range(1500))


def test_two_files_that_are_the_same_but_for_the_order_say_so_and_what_it_costs(files):
    found = diagnose(*files)
    order, reading = found.found.order, found.a.reading
    assert found.same, found.verdict
    assert order.sentence in found.verdict
    assert (order.first[:3], order.second[:3]) == (
        ("FL_hip", "FL_thigh", "FL_calf"),
        ("FR_hip", "FR_thigh", "FR_calf"),
    )
    tau = inverse_dynamics(tree_of(with_gravity(reading)), draw(with_gravity(reading), STATES, 0))
    names = list(reading.joints)
    off = np.abs(tau - tau[:, [names.index(name) for name in order.second]])
    assert order.value == pytest.approx(off.max())
    assert order.largest == pytest.approx(np.abs(tau).max())
    assert summary(found)["order"]["value"] == order.value


def test_nothing_is_said_where_orders_are_the_same(files, write):
    urdf, mjcf = (write(name, text) for name, text in zip(("s.urdf", "s.xml"), quadruped(sorted(LEGS)), strict=True))
    for a, b in ((urdf, mjcf), (files[1], files[1]), (files[0], files[0])):
        found = diagnose(a, b)
        assert found.found.order is None
        assert "index" not in found.verdict


def test_it_is_said_after_a_difference_and_beside_other_names(files, write):
    other = files[1].read_text(encoding="utf-8").replace('mass="1.1"', 'mass="1.2"').replace('"FR_hip"', '"FR.hip"')
    found = diagnose(files[0], write("other.xml", other))
    assert not found.same
    assert "FR.hip, FR_thigh" in found.found.order.sentence in found.verdict


def test_joints_are_named_from_where_the_orders_part(write):
    urdf, mjcf = quadruped(("FL", "RR", "FR", "RL"))
    order = diagnose(write("q.urdf", urdf), write("q.xml", mjcf)).found.order
    assert order.first[:3] == order.second[:3]
    for words in ("as FR_hip, FR_thigh", "as RR_hip, RR_thigh", "(from joint 4 on)"):
        assert words in order.sentence


@pytest.mark.parametrize("which", [0, 1])
def test_an_import_says_so(which, files, command, inside):
    said = command("import", str(files[which]), "--out", "made.toml").out
    for words in ("as FL_hip, FL_thigh, FL_calf", "as FR_hip, FR_thigh, FR_calf", "compared by index"):
        assert words in said


def test_an_import_of_a_chain_says_nothing_of_it(command, inside, write):
    file = write("chain.urdf", quadruped(("FR",))[0])
    assert "index" not in command("import", file).out
