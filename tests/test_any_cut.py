"""Any joint may close a loop: the cut is chosen so that every format can say it, whatever the order of the joints."""

from __future__ import annotations

from itertools import islice, permutations
from pathlib import Path

import numpy as np
import pytest
from tolerances import ROUNDING

import screwgauge
from screwgauge.models.layout import lay_out

ENGINES = ("screw", "pinocchio", "mujoco", "pinocchio-full", "mujoco-full", "truth")
X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]
A, B, C, D = ["3/5", 0, "4/5"], [0, "5/13", "12/13"], ["2/3", "2/3", "1/3"], ["-6/7", "2/7", "3/7"]


def u(first: float, second: float) -> list[list[object]]:
    """Two axes at right angles: the first turned from x to y, the second from its normal in that plane to z."""
    c, s = f"cos({first})", f"sin({first})"
    return [[c, s, 0], [f"-({s})*cos({second})", f"({c})*cos({second})", f"sin({second})"]]


#: Name -> independent coordinates, and joints with their points and axes at home, where frames are those of the world.
#: A capital after the kind marks an actuator.
MECHANISMS = {
    "slider-crank": (
        ["a"],
        {
            "a": ("R*", "ground crank", [0, 0, 0], [Y]),
            "b": ("R", "crank rod", [0.1, 0, 0.2], [Y]),
            "c": ("R", "rod piston", [0.7, 0, 0], [Y]),
            "d": ("P", "ground piston", [0.7, 0, 0], [X]),
        },
    ),
    "five-bar": (
        ["a", "d"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [Y]),
            "b": ("P", "one two", [0.1, 0, 0.3], [["3/5", 0, "4/5"]]),
            "c": ("R", "two three", [0.5, 0, 0.7], [Y]),
            "e": ("R", "four three", [0.7, 0, 0.4], [Y]),
            "d": ("P*", "ground four", [0.7, 0, 0], [["5/13", 0, "12/13"]]),
        },
    ),
    "driven everywhere": (
        ["a"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [Y]),
            "b": ("R*", "one two", [0, 0, 0.2], [Y]),
            "c": ("R*", "three two", [0.5, 0, 0.4], [Y]),
            "d": ("R*", "ground three", [0.4, 0, 0], [Y]),
        },
    ),
    "rccc": (
        ["a"],
        {
            "a": ("R*", "ground one", [0, 0, 0], [A]),
            "b": ("C", "one two", [0.3, 0.1, 0.2], [B]),
            "c": ("C", "two three", [0.4, 0.6, 0.1], [C]),
            "d": ("C", "three ground", [0.1, 0.5, -0.3], [D]),
        },
    ),
    "uuuu": (
        ["a.q1", "b.q2"],
        {
            "a": ("U", "ground one", [0, 0, 0], u(0.3, 1.5)),
            "b": ("U", "one two", [0.1, 0.1, 0.4], u(1.1, -0.4)),
            "c": ("U", "two three", [0.6, 0.2, 0.5], u(-0.6, -0.9)),
            "d": ("U", "three ground", [0.5, -0.2, 0.1], u(2.0, 0.2)),
        },
    ),
    "3-upu": (
        ["s0", "s1", "s2"],
        {
            f"{name}{k}": (kind, sides.replace("#", str(k)), [f"{r}*cos({at})", f"{r}*sin({at})", z], axes)
            for k, at in enumerate(("0.1", "2.2", "4.1"))
            for name, kind, sides, r, z, axes in (
                ("u", "U", "ground lower#", 0.5, 0, u(f"{at}+pi/2", 0.4)),
                ("s", "P*", "lower# upper#", 0.4, 0.3, [[f"-0.28*cos({at})", f"-0.28*sin({at})", 0.96]]),
                ("v", "U", "upper# platform", 0.3, 0.6, u(f"{at}+pi/2", 0.4)),
            )
        },
    ),
    "stewart": (
        [f"pose.{name}" for name in ("x", "y", "z", "q1", "q2", "q3")],
        {"pose": ("F", "ground platform", [0, 0, 0.7], [Z, Y, X])}
        | {
            f"{name}{k}": (kind, sides.replace("#", str(k)), [f"{r}*cos({at})", f"{r}*sin({at})", z], axes)
            for k, (at, to) in enumerate((("0.2", "0.8"), ("1.9", "1.4"), ("2.3", "2.9"), ("4", "3.5"), ("4.4", "5"), ("-0.2", "-0.8")))
            for name, kind, sides, r, at, z, axes in (
                ("u", "U", "ground lower#", 0.6, at, 0, u(0.3, 0.4)),
                ("s", "P*", "lower# upper#", 0.4, at, 0.3, [A]),
                ("v", "S", "upper# platform", 0.3, to, 0.6, [X, Y, Z]),
            )
        },
    ),
}


def described(name: str, order: tuple[str, ...], folder: Path) -> Path:
    """Writes a mechanism, its joints in some order, and a scene of it; inertia is full, at random."""
    chosen, joints = MECHANISMS[name]
    rng = np.random.default_rng(len(name))
    bodies = sorted({body for _, sides, _, _ in joints.values() for body in sides.split()} - {"ground"})
    lines = [f'name = "{name.replace(" ", "-")}"', "[independent]", *(f'y{i} = "{q}"' for i, q in enumerate(chosen))]
    for body in bodies:
        (a, b, c), (d, e, f) = rng.uniform(0.05, 0.09, 3).round(4), rng.uniform(-0.01, 0.01, 3).round(4)
        com = rng.uniform(-0.2, 0.6, 3).round(3).tolist()
        inertia = f"{{ xx = {a}, yy = {b}, zz = {c}, xy = {d}, xz = {e}, yz = {f} }}"
        lines += [f"[bodies.{body}]", f"mass = {rng.uniform(0.5, 2):.3f}", f"com = {com}", f"inertia = {inertia}"]
    for joint in order:
        kind, sides, point, axes = joints[joint]
        parent, child = sides.split()
        lines += [f"[joints.{joint}]", f'kind = "{kind[0]}"', f'parent = "{parent}"', f'child = "{child}"']
        lines += [f"axes = {axes}", f"actuated = {str('*' in kind).lower()}"]
        lines += [f"{side}_frame.position = {point}" for side in ("parent", "child")]
    (folder / "mechanism.toml").write_text("\n".join(lines))
    scene = ['mechanism = "mechanism.toml"', "gravity = [1, 2, -9]", "time = { duration = 0.6, step = 0.1 }"]
    scene += [f"motion.y{i} = {{ harmonics = [[3, 0, {0.04 - 0.01 * i}]] }}" for i in range(len(chosen))]
    scene += [f'[[loads]]\non = "{bodies[-1]}"\nby = "environment"\npoint = [0.1, 0, 0]\nforce = [3, -5, 2]']
    (folder / "scene.toml").write_text("\n".join(scene))
    return folder / "scene.toml"


def orders(name: str) -> list[tuple[str, ...]]:
    """As written, backwards, and one in between."""
    written = tuple(MECHANISMS[name][1])
    return [written, written[::-1], written[1:] + written[:1]]
