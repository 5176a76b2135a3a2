"""The same MJCF, said differently, by its XML; where its loops close in another pose, by MuJoCo."""

import copy
import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from campaigns.corpus.mjcf_frames import CannotError, check_movable, in_degrees, move_frame, put_pose
from campaigns.corpus.poses import Array, Random, frame, numbers, of_quaternion, pose, text
from campaigns.corpus.scrambled import ALL, FRAMES, HOME, NAMES, ORDER, SIGNS, Scrambled, numbered, shuffled

#: Attribute -> kind of what it names.
REFERENCES = {
    **dict.fromkeys(("body", "body1", "body2", "target", "site_body"), "body"),
    **dict.fromkeys(("joint", "joint1", "joint2", "jointinparent"), "joint"),
    **dict.fromkeys(("site", "site1", "site2", "refsite", "cranksite", "slidersite"), "site"),
    **dict.fromkeys(("tendon", "tendon1", "tendon2"), "tendon"),
}
#: Farther from home [rad or m] another assembly may be where Newton's method ends.
FAR = 0.8
WORDS = {"body": "part", "joint": "pivot", "site": "spot", "tendon": "cord"}


def scramble_mjcf(root: ET.Element, rng: Random, do: frozenset[str] = ALL) -> Scrambled:
    """A copy with other names, order, frames of bodies, home pose and directions of axes, the machine being the same.

    Sensors, keyframes, contacts and what is only seen are left out, since they stand in names, orders and homes that
    change.

    Raises:
        CannotError: It has what is not rewritten here.
    """
    done = Scrambled(copy.deepcopy(root))
    tree = done.root
    check_movable(tree)
    start = next((numbers(key.get("qpos", "")) for key in tree.iterfind("keyframe/key") if key.get("qpos")), None)
    _stripped(tree)
    if HOME in do:
        _another_home(tree, rng, done, start)
    coupled = _coupled(tree)
    if SIGNS in do:
        _reverse_some(tree, rng, done, coupled)
    if FRAMES in do:
        _move_frames(tree, rng, done)
    if NAMES in do:
        _rename(tree, rng, done)
    if ORDER in do:
        for body in [*tree.iterfind("worldbody"), *tree.iterfind("worldbody//body")]:
            shuffled(body, rng, ["body"])
        for room in [*tree.iterfind("equality"), *tree.iterfind("actuator")]:
            shuffled(room, rng)
    return done


def _reverse_some(tree: ET.Element, rng: Random, done: Scrambled, coupled: set[str]) -> None:
    for joint in tree.iterfind("worldbody//joint"):
        if joint.get("type") != "ball" and joint.get("name") not in coupled and rng.random() < 0.4:
            _reverse(tree, joint, done)


def _move_frames(tree: ET.Element, rng: Random, done: Scrambled) -> None:
    for body in [*tree.iterfind("worldbody//body")]:
        if body.find("freejoint") is None and body.find("joint[@type='free']") is None:
            X = frame(rng)
            move_frame(tree, body, X)
            done.frames[body.get("name", "")] = X


def _stripped(tree: ET.Element) -> None:
    for tag in ("keyframe", "sensor", "contact", "visual", "statistic", "custom"):
        for room in tree.findall(tag):
            tree.remove(room)
    for parent in [*tree.iter()]:
        for child in [*parent]:
            if child.tag in ("camera", "light"):
                parent.remove(child)


def _coupled(tree: ET.Element) -> set[str]:
    """Joints in couplings or tendons."""
    some = {part.get(name, "") for room in tree.iterfind("equality") for part in room for name in ("joint1", "joint2")}
    return some | {joint.get("joint", "") for joint in tree.iterfind("tendon/fixed/joint")}


def _reverse(tree: ET.Element, joint: ET.Element, done: Scrambled) -> None:
    name = joint.get("name", "")
    joint.set("axis", text(-numbers(joint.get("axis", "0 0 1"))))
    for entry in ("range", "actuatorfrcrange"):
        if joint.get(entry):
            low, high = numbers(joint.get(entry, ""))
            joint.set(entry, text([-high, -low]))
    for entry in ("springref", "ref"):
        if joint.get(entry):
            joint.set(entry, text(-numbers(joint.get(entry, ""))))
    for motor in tree.iterfind("actuator/*"):
        if motor.get("joint") == name:
            motor.set("gear", text(-numbers(motor.get("gear", "1"))))
    done.flipped.add(name)


def _rename(tree: ET.Element, rng: Random, done: Scrambled) -> None:
    maps = {}
    for kind, word in WORDS.items():
        tags = {"body": ["body"], "joint": ["joint", "freejoint"], "site": ["site"], "tendon": ["fixed", "spatial"]}[
            kind
        ]
        owners = [e for tag in tags for e in tree.iter(tag) if e.get("name")]
        maps[kind] = numbered([e.get("name") for e in owners], word, rng)
        for element in owners:
            element.set("name", maps[kind][element.get("name", "")])
    for element in tree.iter():
        for entry, kind in REFERENCES.items():
            if element.get(entry) in maps[kind] and element.tag not in ("default", "body"):
                element.set(entry, maps[kind][element.get(entry, "")])
    rooms = {"equality": "tie", "actuator": "motor"}
    for room, word in rooms.items():
        parts = [part for one in tree.iterfind(room) for part in one if part.get("name")]
        maps[room] = numbered([part.get("name") for part in parts], word, rng)
        for part in parts:
            part.set("name", maps[room][part.get("name", "")])
    done.names = {f"{kind} {old}": new for kind, some in maps.items() for old, new in some.items()}


def _another_home(tree: ET.Element, rng: Random, done: Scrambled, start: Array | None) -> None:
    import mujoco

    if tree.find(".//freejoint") is not None or tree.find(".//joint[@type='free']") is not None:
        raise CannotError("moves freely")
    if any(joint.get("ref") for joint in tree.iter("joint")):
        raise CannotError("has a ref")
    model = mujoco.MjModel.from_xml_string(ET.tostring(tree, encoding="unicode"))
    data = mujoco.MjData(model)
    qpos = closed_pose(model, data, rng, start)
    poses = [pose(of_quaternion(data.xquat[i]), data.xpos[i]) for i in range(model.nbody)]
    degrees = in_degrees(tree)
    for body in tree.iterfind("worldbody//body"):
        k = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body.get("name"))
        T, near = poses[k], poses[model.body_parentid[k]]
        put_pose(body, np.linalg.inv(near) @ T)
        for joint in body.iterfind("joint"):
            j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint.get("name"))
            joint.set("pos", text(T[:3, :3].T @ (data.xanchor[j] - T[:3, 3])))
            if joint.get("type") == "ball":
                continue
            joint.set("axis", text(T[:3, :3].T @ data.xaxis[j]))
            q = float(qpos[model.jnt_qposadr[j]])
            done.homes[joint.get("name", "")] = q
            scale = 180.0 / np.pi if degrees and joint.get("type", "hinge") == "hinge" else 1.0
            for entry in ("range", "springref"):
                if joint.get(entry):
                    joint.set(entry, text(numbers(joint.get(entry, "")) - scale * q))
                elif entry == "springref" and joint.get("stiffness"):
                    joint.set(entry, text(-scale * q))
    for part in tree.iterfind("equality/joint"):
        _move_coupling(part, done.homes)


def _move_coupling(part: ET.Element, homes: dict[str, float]) -> None:
    offset, slope, *more = numbers(part.get("polycoef", "0 1 0 0 0"))
    if any(more):
        raise CannotError("a coupling that is no line")
    first, second = homes[part.get("joint1", "")], homes.get(part.get("joint2", ""), 0.0)
    part.set("polycoef", text([offset + slope * second - first, slope, 0.0, 0.0, 0.0]))


def closed_pose(model: Any, data: Any, rng: Random, start: Array | None, size: float = 0.2) -> Array:
    """A pose near home in which connects, welds and couplings hold, by Newton's method.

    Args:
        start: Home; the model's own zero where it is None.

    Raises:
        CannotError: There is none nearby.
    """
    import mujoco

    start = model.qpos0 if start is None else start
    for attempt in range(20):
        step = size * 0.8**attempt * rng.normal(size=model.nv)
        qpos = start.copy()
        mujoco.mj_integratePos(model, qpos, step, 1.0)
        for _ in range(60):
            data.qpos[:] = qpos
            mujoco.mj_fwdPosition(model, data)
            rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
            gap = data.efc_pos[: data.nefc][rows]
            if not gap.size or np.abs(gap).max() < 1e-14:
                break
            J = _rows(model, data)[rows]
            mujoco.mj_integratePos(model, qpos, -np.linalg.pinv(J, rcond=1e-9) @ gap, 1.0)
        if (not gap.size or np.abs(gap).max() < 1e-12) and np.abs(qpos - start).max() < FAR:
            mujoco.mj_kinematics(model, data)
            return np.asarray(qpos)
    raise CannotError("no other pose closes its loops")


def _rows(model: Any, data: Any) -> Array:
    import mujoco

    if not mujoco.mj_isSparse(model):
        return np.asarray(data.efc_J).reshape(-1, model.nv)[: data.nefc]
    J = np.zeros((data.nefc, model.nv))
    mujoco.mju_sparse2dense(J, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    return J
