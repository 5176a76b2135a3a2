"""Descriptions (TOML) of mechanisms that grow: legs of one kind side by side, joints of one kind in a row."""

from math import cos, pi, sin


def legs(n: int) -> str:
    """A platform on an S joint at the origin, held against yaw by a UPU leg, and n - 1 actuated UPS legs around it."""
    lines = ["name = 'legs'", "[independent]", "a = 's.q1'", "b = 's.q2'", *_body("platform", "[0, 0, 0.5]", 3)]
    lines += [*_joint("s", "S", "ground", "platform", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]")]
    for k in range(n):
        angle, wrist = 2.0 * pi * k / n, "S" if k else "U"
        lines += [*_body(f"lower{k}", "[0, 0, 0.15]", 1), *_body(f"upper{k}", "[0, 0, -0.15]", 1)]
        lines += _joint(f"base{k}", "U", "ground", f"lower{k}", "[[1, 0, 0], [0, 1, 0]]")
        lines += ["home = [0, '-pi/6']", f"parent_frame = {_placed(0.8, 0.0, angle)}"]
        lines += _joint(f"slide{k}", "P", f"lower{k}", f"upper{k}", "[[0, 0, 1]]")
        lines += ["home = [0.6]", "actuated = true"]
        axes = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]" if k else "[[1, 0, 0], [0, 1, 0]]"
        lines += _joint(f"wrist{k}", wrist, f"upper{k}", "platform", axes)
        lines += [f"home = [0, 'pi/6'{', 0' * (k > 0)}]", f"child_frame = {_placed(0.5, 0.3 * 3**0.5, angle)}"]
    return "\n".join(lines)


def arm(n: int) -> str:
    lines = ["name = 'arm'", "[independent]", *(f"q{k} = 'joint{k}'" for k in range(n))]
    for k in range(n):
        lines += _body(f"link{k}", "[0.05, 0.01, 0]", 1)
        near = f"link{k - 1}" if k else "ground"
        lines += [*_joint(f"joint{k}", "R", near, f"link{k}", "[[0, 0, 1]]"), "home = [0.3]", "actuated = true"]
        lines += ["parent_frame = { position = [0.1, 0, 0], rotation = { axis = [1, 0, 0], angle = 'pi/2' } }"]
    return "\n".join(lines)


def _body(name: str, com: str, mass: int) -> list[str]:
    inertia = f"inertia = {{ xx = {0.011 * mass}, yy = {0.012 * mass}, zz = {0.002 * mass} }}"
    return [f"[bodies.{name}]", f"mass = {mass}", f"com = {com}", inertia]


def _joint(name: str, kind: str, parent: str, child: str, axes: str) -> list[str]:
    return [f"[joints.{name}]", f"kind = '{kind}'", f"parent = '{parent}'", f"child = '{child}'", f"axes = {axes}"]


def _placed(radius: float, height: float, angle: float) -> str:
    position = f"[{radius * cos(angle)!r}, {radius * sin(angle)!r}, {height!r}]"
    return f"{{ position = {position}, rotation = {{ axis = [0, 0, 1], angle = {angle!r} }} }}"
