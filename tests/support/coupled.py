"""Mechanisms with couplings of every kind, as text of descriptions and scenes."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from numpy.polynomial.polynomial import polyval

import screwgauge
from screwgauge import Scene

Write = Callable[[str, str], Path]
#: Coupled coordinate -> the one that it depends on, or nothing, and the coefficients.
Couplings = Mapping[str, tuple[str, Sequence[float]]]


def homes(couplings: Couplings, start: Mapping[str, float]) -> dict[str, float]:
    home = dict(start)
    for name, (of, polynomial) in couplings.items():
        home[name] = float(polyval(home.get(of, 0.0), polynomial))
    return home


def coupling_tables(couplings: Couplings) -> str:
    text = ""
    for name, (of, polynomial) in reversed(couplings.items()):
        text += f'[couplings."tie.{name}"]\ncoordinate = "{name}"\npolynomial = {list(map(repr, polynomial))}\n'
        text += f'of = "{of}"\n' if of else ""
    return text


def body(name: str, i: int) -> str:
    xx, yy, zz, xy = 0.02 + 0.003 * i, 0.03 - 0.001 * i, 0.025 + 0.002 * i, 0.002
    tensor = f"{{ xx = {xx!r}, yy = {yy!r}, zz = {zz!r}, xy = {xy!r} }}"
    return f'[bodies."{name}"]\nmass = {1.0 + 0.3 * i!r}\ncom = [0.05, {0.02 * i!r}, -0.03]\ninertia = {tensor}\n'


#: Coordinates of one joint of each kind on two driven ones, of which they are polynomials, some over others.
EVERY_KIND: Couplings = {
    "u.q1": ("a", [0.1, 0.5, 0.4]),
    "u.q2": ("b", [-0.3, 1.2]),
    "s.q1": ("a", [0.0, -0.7]),
    "s.q2": ("b", [0.2, 0.1, 0.3, -0.2]),
    "s.q3": ("u.q1", [0.05, 1.5]),
    "c.q1": ("b", [0.0, 3.0]),
    "c.q2": ("c.q1", [0.1, 0.05]),
    "p": ("a", [0.02, 0.2, 0.1, 0.05, 0.02]),
    "r": ("", [0.4]),
    "f.x": ("b", [0.3, 0.1]),
    "f.y": ("", [0.2]),
    "f.z": ("f.x", [0.1, 0.5, 0.5]),
    "f.q1": ("a", [0.1, 0.8]),
    "f.q2": ("b", [0.2, -0.3]),
    "f.q3": ("", [-0.1]),
    "e.q1": ("a", [0.1, 0.3]),
    "e.q2": ("b", [-0.1, 0.4, 0.2]),
    "e.q3": ("e.q2", [0.2, 2.0]),
}
_KINDS = (  # joint, kind, parent, child, axes
    ("a", "R", "ground", "A", [[0, 0, 1]]),
    ("b", "R", "A", "B", [[0, 1, 0]]),
    ("u", "U", "B", "C", [[1, 0, 0], [0, 1, 0]]),
    ("s", "S", "C", "D", [[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    ("c", "C", "E", "D", [[0, 0, 1]]),
    ("p", "P", "F", "B", [[1, 0, 0]]),
    ("r", "R", "D", "G", [[0, 1, 0]]),
    ("f", "F", "A", "H", [[0, 0, 1], [0, 1, 0], [1, 0, 0]]),
    ("e", "E", "I", "C", [[0.6, 0, 0.8]]),
)


def every_kind(couplings: Couplings = EVERY_KIND) -> str:
    home = homes(couplings, {"a": 0.3, "b": -0.2})
    text = 'name = "every-kind"\nindependent = { a = "a", b = "b" }\n'
    text += "".join(body(name, i) for i, name in enumerate("ABCDEFGHI"))
    for i, (name, kind, parent, child, axes) in enumerate(_KINDS):
        own = [x for x in home if x.partition(".")[0] == name]
        turned = f'{{ axis = [1, 0, 0], angle = "{0.2 * i:.3f}" }}'
        text += f'[joints.{name}]\nkind = "{kind}"\nparent = "{parent}"\nchild = "{child}"\naxes = {json.dumps(axes)}\n'
        text += f"home = {[home[x] for x in own]}\nactuated = {'true' if name in 'ab' else 'false'}\n"
        text += f"parent_frame = {{ position = [0.1, {0.05 * i!r}, 0.2], rotation = {turned} }}\n"
        text += "child_frame = { position = [0, 0.02, -0.1] }\n"
    return text + coupling_tables(couplings)


def geared_five_bar(of: str, coordinate: str, polynomial: Sequence[float]) -> str:
    return f"""name = "geared-five-bar"
extends = "five-bar"
independent = {{ left = "left" }}
[joints.right]
actuated = false
[couplings.gear]
coordinate = "{coordinate}"
of = "{of}"
polynomial = {list(map(repr, polynomial))}
"""


def moving(write: Write, text: str, offsets: Mapping[str, float], loaded: str) -> Scene:
    """A mechanism driven by sines about home, some samples of it, under a force on a body.

    Args:
        text: Its description.
        offsets: Label of each independent coordinate -> its home value.
    """
    write("coupled.toml", text)
    scene = 'mechanism = "coupled.toml"\ntime = { times = [0, 0.1, 0.35, 0.6, 0.85] }\n'
    scene += f'[[loads]]\nby = "environment"\non = "{loaded}"\nforce = [1, 2, 3]\n'
    for i, (label, offset) in enumerate(offsets.items()):
        sines = [[2.0 + i, 0.0, 0.3], [5.0 - i, 0.0, 0.1]]
        scene += f"[motion.{label}]\noffset = {offset!r}\nharmonics = {sines}\n"
    return screwgauge.load_scene(write("coupled-scene.toml", scene))


def started(write: Write, text: str, offsets: Mapping[str, float]) -> Scene:
    write("coupled.toml", text)
    start = ", ".join(f"{label} = {value!r}" for label, value in offsets.items())
    rates = ", ".join(f"{label} = 1.0" for label in offsets)
    scene = f'mechanism = "coupled.toml"\n[forward]\nstart = {{ {start} }}\nrates = {{ {rates} }}\n'
    return screwgauge.load_scene(write("coupled-free.toml", scene + "[time]\nduration = 0.2\nstep = 0.1\n"))
