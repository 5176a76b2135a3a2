"""Random trees, most of them floating, held by one to three random contacts: every pair of four engines agrees."""

import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from campaigns.verdict import judged

import screwgauge
from screwgauge import ScrewgaugeError
from screwgauge.study.run import run

ENGINES = ("screw", "pinocchio", "mujoco", "lagrange")
COUNT = 200
#: Kinds of joint with their axes; two of three are hinges.
KINDS = [*["R"] * 4, "P", "U", "S"]
AXES = {"U": "[[1, 0, 0], [0, 1, 0]]", "S": "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]"}
BASE = [f"base.{name}" for name in ("x", "y", "z", "q1", "q2", "q3")]
#: True reasons for a refusal: contacts hold all that is driven, a motion leaves what loops reach, something falls fast.
REFUSED = (
    "no degree of freedom",
    "no coordinate with a motion can move",
    "cannot close",
    "breaks off",
    "remove one of these joints",
)


def vector(x: np.ndarray) -> str:
    return f"[{', '.join(map(repr, x.tolist()))}]"


def unit(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def drawn(rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    n, floats = int(rng.integers(3, 8)), rng.random() < 0.7
    parts, independent, driven = [], list[str](), dict[str, float]()
    for i in range(n):
        spread = rng.normal(scale=0.05, size=(3, 3))
        J = spread @ spread.T + 1e-3 * np.eye(3)
        I = np.trace(J) * np.eye(3) - J
        entries = ", ".join(f"{'xyz'[a]}{'xyz'[b]} = {I[a, b]!r}" for a in range(3) for b in range(a, 3))
        entries = re.sub(r"np\.float64\(([^)]*)\)", r"\1", entries)
        com = vector(rng.normal(scale=0.1, size=3))
        parts.append(f"[bodies.b{i}]\nmass = {rng.uniform(0.5, 3.0)}\ncom = {com}\ninertia = {{ {entries} }}")
        if not i and floats:
            home = vector(np.concatenate([rng.normal(scale=0.2, size=3), rng.uniform(-0.4, 0.4, 3)]))
            parts.append(f'[joints.base]\nkind = "F"\nparent = "ground"\nchild = "b0"\nhome = {home}')
            independent += BASE
            continue
        kind, near = str(rng.choice(KINDS)), f"b{rng.integers(i)}" if i else "ground"
        count = {"U": 2, "S": 3}.get(kind, 1)
        names, home = (
            [f"j{i}.q{k + 1}" for k in range(count)] if count > 1 else [f"j{i}"],
            rng.uniform(-0.4, 0.4, count),
        )
        parts.append(
            f'[joints.j{i}]\nkind = "{kind}"\nparent = "{near}"\nchild = "b{i}"\nhome = {vector(home)}\n'
            f"axes = {AXES.get(kind, f'[{vector(unit(rng))}]')}\n"
            f"parent_frame.position = {vector(rng.normal(scale=0.3, size=3))}\n"
            f"child_frame.position = {vector(rng.normal(scale=0.1, size=3))}\nactuated = {str(count == 1).lower()}"
        )
        independent += names
        driven |= dict(zip(names, home.tolist(), strict=True)) if count == 1 else {}
    labels = "\n".join(f'"{name}" = "{name}"' for name in independent)
    return "\n".join(['name = "tree"', "[independent]", labels, *parts, ""]), driven


def contacts(rng: np.random.Generator, text: str) -> str:
    bodies, out = re.findall(r"\[bodies\.(\w+)\]", text), []
    for k in range(int(rng.integers(1, 4))):
        kind = str(rng.choice(["weld", "hinge", "point", "point"]))
        axis = f"axis = {vector(unit(rng))}\n" if kind == "hinge" else ""
        point = vector(rng.normal(scale=0.15, size=3))
        out.append(
            f'[[contacts]]\nname = "c{k}"\nbody = "{rng.choice(bodies)}"\nkind = "{kind}"\npoint = {point}\n{axis}'
        )
    return "\n".join(out)


def outcome(seed: int, folder: Path) -> str:
    """The verdict of engines, or why the scene is refused; what contacts make follow is left out of the motion."""
    rng = np.random.default_rng(seed)
    text, driven = drawn(rng)
    held = contacts(rng, text)
    (folder / "tree.toml").write_text(text)
    while driven:
        motion = "".join(
            f"motion.{name} = {{ offset = {at + 0.05}, harmonics = [[3, 0, 0.04]] }}\n" for name, at in driven.items()
        )
        lines = f'mechanism = "tree.toml"\ntime = {{ duration = 0.2, step = 0.05 }}\n{motion}{held}'
        (folder / "held.toml").write_text(lines)
        try:
            return str(judged(run(screwgauge.load_scene(folder / "held.toml"), ENGINES))["verdict"])
        except ScrewgaugeError as error:
            follow = re.search(r"remove (.*) from the motion", error.remedy)
            if not follow:
                return next((reason for reason in REFUSED if reason in str(error)), str(error))
            driven = {name: at for name, at in driven.items() if name not in follow[1].split(", ")}
    return "nothing is driven"


@pytest.mark.campaign
def test_engines_agree_on_trees_that_contacts_hold(campaign, tmp_path):
    found = Counter(outcome(seed, tmp_path) for seed in range(campaign.count or COUNT))
    assert {*found} <= {"agree", "estimated", "nothing is driven", *REFUSED}, found
    assert found["agree"] > 0.7 * found.total()
