import numpy as np
from campaigns.corpus.linkage import GROUND, Body, Joint, Linkage
from campaigns.corpus.poses import EYE, Array, inverse, point, pose, text, to_quaternion, to_rpy

#: How far apart two points of an axis are that close a loop at a hinge [m].
REACH = 0.1


def write_urdf(machine: Linkage) -> tuple[str, str]:
    """Its tree, and a robot.yaml that closes its loops, empty where there are none.

    Each joint frame is the frame of the child, moved along the axis to where that comes next to the child's frame; so a
    URDF has them: a hinge's axis goes through the origin of the link.
    """
    joints, links = list[str](), [f'<link name="{GROUND}"/>']
    frames = {GROUND: np.eye(4)}
    for joint in machine.tree():
        body = next(b for b in machine.bodies if b.name == joint.child)
        T = machine.frame_of(body.name)
        frames[body.name] = pose(T[:3, :3], _origin(joint, T[:3, 3]))
        steps = _hinges(joint)
        before = joint.parent
        for i, (kind, axis) in enumerate(steps):
            last = i == len(steps) - 1
            child = joint.child if last else f"{joint.name}.carrier{i}"
            frames.setdefault(child, pose(p=joint.point))
            name = joint.name if len(steps) == 1 else f"{joint.name}.{i}"
            joints.append(_urdf_joint(name, kind, before, child, frames, axis, joint))
            links += [] if last else [f'<link name="{child}"/>']
            before = child
        links.append(_urdf_link(body, frames[body.name]))
    pairs = list[list[str]]()
    for joint in machine.closures():
        for i, p in enumerate(_points(joint)):
            pairs.append([])
            for side, owner in (("a", joint.parent), ("b", joint.child)):
                mark = f"{joint.name}_{i}{side}"
                where = text(point(inverse(frames[owner]), p))
                links.append(f'<link name="{mark}"/>')
                joints.append(
                    f'<joint name="{mark}_fixed" type="fixed"><origin xyz="{where}" rpy="0 0 0"/>'
                    f'<parent link="{owner}"/><child link="{mark}"/></joint>'
                )
                pairs[-1].append(mark)
    urdf = "\n  ".join([f'<robot name="{machine.name}">', *links, *joints]) + "\n</robot>\n"
    motors = [joint.name for joint in machine.joints if joint.actuated]
    quoted = ", ".join(f"['{a}', '{b}']" for a, b in pairs)
    types = ", ".join(["'3d'"] * len(pairs))
    yaml = f"closed_loop: [{quoted}]\ntype: [{types}]\nname_mot: [{', '.join(repr(m) for m in motors)}]\n"
    return urdf, yaml if pairs else ""


def _origin(joint: Joint, near: Array) -> Array:
    """Return other places for the frame of a link behind a joint: on the axes of its turns."""
    if joint.kind == "P":
        return near
    if joint.kind == "R":
        return np.asarray(joint.point + ((near - joint.point) @ joint.axes[0]) * joint.axes[0])
    return joint.point


def _hinges(joint: Joint) -> list[tuple[str, Array]]:
    if joint.kind == "S":
        return [("continuous", axis) for axis in EYE]
    kind = "prismatic" if joint.kind == "P" else "continuous"
    return [(kind, axis) for axis in joint.axes]


def _urdf_joint(
    name: str, kind: str, parent: str, child: str, frames: dict[str, Array], axis: Array, joint: Joint
) -> str:
    T = inverse(frames[parent]) @ frames[child]
    more = f'<dynamics damping="{text(joint.damping)}"/>' if joint.damping else ""
    if joint.limits is not None:
        low, high = joint.limits
        kind = "revolute" if kind == "continuous" else kind
        more += f'<limit lower="{text(low)}" upper="{text(high)}" effort="100" velocity="10"/>'
    elif kind == "prismatic":
        more += '<limit lower="-10" upper="10" effort="100" velocity="10"/>'
    return (
        f'<joint name="{name}" type="{kind}"><origin xyz="{text(T[:3, 3])}" rpy="{text(to_rpy(T[:3, :3]))}"/>'
        f'<parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{text(frames[child][:3, :3].T @ axis)}"/>{more}</joint>'
    )


def _urdf_link(body: Body, T: Array) -> str:
    I = T[:3, :3].T @ body.inertia @ T[:3, :3]
    entries = " ".join(f'i{a}{b}="{text(I[i, j])}"' for i, a in enumerate("xyz") for j, b in enumerate("xyz") if j >= i)
    return (
        f'<link name="{body.name}"><inertial><origin xyz="{text(point(inverse(T), body.com))}" rpy="0 0 0"/>'
        f'<mass value="{text(body.mass)}"/><inertia {entries}/></inertial></link>'
    )


def _points(joint: Joint) -> list[Array]:
    if joint.kind == "S":
        return [joint.point]
    if joint.kind == "R":
        return [joint.point - REACH / 2.0 * joint.axes[0], joint.point + REACH / 2.0 * joint.axes[0]]
    raise ValueError(f"{joint.name}: no points hold a joint {joint.kind}")


def write_mjcf(machine: Linkage) -> str:
    tree = machine.tree()

    def body(joint: Joint) -> str:
        part = next(b for b in machine.bodies if b.name == joint.child)
        T, near = machine.frame_of(part.name), machine.frame_of(joint.parent)
        at, R = inverse(near) @ T, T[:3, :3]
        I = R.T @ part.inertia @ R
        entries = text([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]])
        inner = "".join(body(other) for other in tree if other.parent == part.name)
        return (
            f'<body name="{part.name}" pos="{text(at[:3, 3])}" quat="{text(to_quaternion(at[:3, :3]))}">'
            f'<inertial pos="{text(point(inverse(T), part.com))}" mass="{text(part.mass)}" fullinertia="{entries}"/>\n'
            f"{_mjcf_joints(joint, T)}{inner}</body>\n"
        )

    world = "".join(body(joint) for joint in tree if joint.parent == GROUND)
    closures = list[str]()
    for joint in machine.closures():
        ends = [("world" if owner == GROUND else owner) for owner in (joint.parent, joint.child)]
        first = machine.frame_of(joint.parent)
        for i, p in enumerate(_points(joint)):
            anchor = text(point(inverse(first), p))
            closures.append(
                f'<connect name="{joint.name}_{i}" body1="{ends[0]}" body2="{ends[1]}" anchor="{anchor}"/>\n'
            )
    motors = [f'<motor name="{j.name}" joint="{j.name}"/>\n' for j in machine.joints if j.actuated]
    return (
        f'<mujoco model="{machine.name}"><compiler angle="radian"/><option gravity="0 0 -9.81"/>\n'
        f"<worldbody>\n{world}</worldbody>\n"
        + (f"<equality>\n{''.join(closures)}</equality>\n" if closures else "")
        + (f"<actuator>\n{''.join(motors)}</actuator>\n" if motors else "")
        + "</mujoco>\n"
    )


def _mjcf_joints(joint: Joint, T: Array) -> str:
    place = text(point(inverse(T), joint.point))
    if joint.kind == "S":
        return f'<joint name="{joint.name}" type="ball" pos="{place}"/>\n'
    kind = "slide" if joint.kind == "P" else "hinge"
    more = f' damping="{text(joint.damping)}"' if joint.damping else ""
    if joint.limits is not None:
        more += f' limited="true" range="{text(joint.limits)}"'
    names = [joint.name] if len(joint.axes) == 1 else [f"{joint.name}.{i}" for i in range(len(joint.axes))]
    return "".join(
        f'<joint name="{name}" type="{kind}" pos="{place}" axis="{text(T[:3, :3].T @ axis)}"{more}/>\n'
        for name, axis in zip(names, joint.axes, strict=True)
    )


def write_toml(machine: Linkage) -> str:
    """A description; it needs no cut."""
    lines = [f'name = "{machine.name}"', "", "[independent]"]
    lines += [f'y{i} = "{name}"' for i, name in enumerate(machine.independent)]
    for body in machine.bodies:
        T = machine.frame_of(body.name)
        I = T[:3, :3].T @ body.inertia @ T[:3, :3]
        some = {a + b: I[i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz") if j >= i}
        entries = ", ".join(f"{name} = {float(value)!r}" for name, value in some.items())
        lines += ["", f'[bodies."{body.name}"]', f"mass = {float(body.mass)!r}"]
        lines += [f"com = {_list(point(inverse(T), body.com))}", f"inertia = {{ {entries} }}"]
    for joint in machine.joints:
        lines += ["", f'[joints."{joint.name}"]', f'kind = "{joint.kind}"', f'parent = "{joint.parent}"']
        lines += [f'child = "{joint.child}"', f"axes = {[*map(_list, joint.axes or EYE)]}".replace("'", "")]
        for side, owner in (("parent", joint.parent), ("child", joint.child)):
            T = inverse(machine.frame_of(owner))
            rows = ", ".join(_list(row) for row in T[:3, :3])
            lines.append(
                f"{side}_frame = {{ position = {_list(point(T, joint.point))}, rotation = {{ matrix = [{rows}] }} }}"
            )
        lines += ["actuated = true"] if joint.actuated else []
    return "\n".join(lines) + "\n"


def _list(v: Array) -> str:
    return f"[{', '.join(repr(float(x)) for x in v)}]"
