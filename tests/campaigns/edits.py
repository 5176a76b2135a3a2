"""Sixty edits of public arms, hands and legs, each put to `diagnose` against the file as it was published.

    python tests/campaigns/edits.py --out reports/edits

Needs the models of ``pip install '.[study]'``. An edit changes physics, changes content beside rigid bodies (tendons,
fluid, actuator laws, contact pairs ...), or only the way in which a file says the same. No edit of the first two kinds
may be called SAME, none of the third DIFFER; and what is said has to name the part that was edited.
"""

from __future__ import annotations

import argparse
import copy
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import screwgauge

DATA, SUITE = "cmeel.prefix/share/example-robot-data/robots", "robosuite/models/assets"
MODELS = {
    "panda": f"{DATA}/panda_description/urdf/panda.urdf",
    "ur5": f"{DATA}/ur_description/urdf/ur5_robot.urdf",
    "z1": f"{DATA}/z1_description/urdf/z1.urdf",
    "xarm7": f"{DATA}/xarm_description/urdf/xarm7.urdf",
    "talos arm": f"{DATA}/talos_data/robots/talos_left_arm.urdf",
    "allegro hand": f"{DATA}/allegro_hand_description/urdf/allegro_right_hand.urdf",
    "solo12": f"{DATA}/solo_description/robots/solo12.urdf",
    "go2": f"{DATA}/go2_description/urdf/go2.urdf",
    "bolt": f"{DATA}/bolt_description/robots/bolt.urdf",
    "sawyer": f"{SUITE}/robots/sawyer/robot.xml",
    "iiwa": f"{SUITE}/robots/iiwa/robot.xml",
    "jaco": f"{SUITE}/robots/jaco/robot.xml",
    "kinova3": f"{SUITE}/robots/kinova3/robot.xml",
    "spot": f"{SUITE}/robots/spot/robot.xml",
    "robotiq hand": f"{SUITE}/grippers/robotiq_gripper_85.xml",
    "jaco hand": f"{SUITE}/grippers/jaco_three_finger_gripper.xml",
    "rethink hand": f"{SUITE}/grippers/rethink_gripper.xml",
}
SEED, COUNT = 2026, 60


class NoPlaceError(Exception):
    """The model has no place for that edit."""


@dataclass(frozen=True, slots=True)
class Edit:
    """What was done.

    Attributes:
        what: In words, with the numbers as they stand in the two files.
        item: Name of the part that a diagnosis has to name; empty where it need not name one.
        beside: Text of a loops file that is put beside the edited file.
    """

    what: str
    item: str = ""
    beside: str = ""


Editor = Callable[[ET.Element, np.random.Generator], Edit]


def pick(found: Iterator[ET.Element] | list[ET.Element], rng: np.random.Generator) -> ET.Element:
    """One of them."""
    some = list(found)
    if not some:
        raise NoPlaceError
    return some[int(rng.integers(len(some)))]


def two_of(found: list, rng: np.random.Generator) -> list:
    """Two of them."""
    if len(found) < 2:
        raise NoPlaceError
    return [found[int(i)] for i in rng.permutation(len(found))[:2]]


def is_urdf(root: ET.Element) -> bool:
    return root.tag == "robot"


def numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def put(element: ET.Element, name: str, values: np.ndarray | list[float]) -> str:
    """Sets an attribute to numbers, and says from what to what."""
    old = element.get(name, "none")
    element.set(name, " ".join(f"{value:.9g}" for value in np.atleast_1d(values)))
    return f"{name} {old} -> {element.get(name)}"


def moving_joints(root: ET.Element) -> list[ET.Element]:
    """Hinges and slides with a name; joints that follow others are left out."""
    if is_urdf(root):
        kinds = ("revolute", "continuous", "prismatic")
        return [j for j in root.iterfind("joint") if j.get("type") in kinds and j.find("mimic") is None]
    return [j for j in root.iterfind("worldbody//joint") if j.get("name") and j.get("type", "hinge") != "ball"]


def bodies(root: ET.Element) -> list[ET.Element]:
    """Links behind a moving joint, or bodies with joints, that have mass; in an MJCF those that state it."""
    if is_urdf(root):
        moved = {j.find("child").get("link") for j in root.iterfind("joint") if j.get("type") != "fixed"}
        links = [link for link in root.iterfind("link") if link.get("name") in moved]
        return [k for k in links if k.find("inertial/mass") is not None and float(k.find("inertial/mass").get("value"))]
    own = [body for body in root.iterfind("worldbody//body") if body.find("joint") is not None]
    return [body for body in own if body.find("inertial") is not None]


def only_mjcf(root: ET.Element) -> None:
    if is_urdf(root):
        raise NoPlaceError


def only_urdf(root: ET.Element) -> None:
    if not is_urdf(root):
        raise NoPlaceError


def child(element: ET.Element, tag: str) -> ET.Element:
    """The first child of that tag, made where there is none."""
    found = element.find(tag)
    return found if found is not None else ET.SubElement(element, tag)


# --- edits of rigid bodies and joints


def mass(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    place, name = (body.find("inertial/mass"), "value") if is_urdf(root) else (body.find("inertial"), "mass")
    return Edit(put(place, name, float(place.get(name)) * (1.0 + rng.uniform(1e-3, 0.2))), body.get("name"))


def centre_of_mass(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    inertial = body.find("inertial")
    place, name = (child(inertial, "origin"), "xyz") if is_urdf(root) else (inertial, "pos")
    step = np.eye(3)[rng.integers(3)] * rng.uniform(1e-4, 2e-2)
    return Edit(put(place, name, numbers(place.get(name, "0 0 0")) + step), body.get("name"))


def inertia(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    place = body.find("inertial/inertia") if is_urdf(root) else body.find("inertial")
    name = "ixx" if is_urdf(root) else "diaginertia" if place.get("diaginertia") else "fullinertia"
    values = numbers(place.get(name))
    values[0] *= 1.0 + rng.uniform(1e-3, 0.05)
    return Edit(put(place, name, values), body.get("name"))


def grams(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    place, name = (body.find("inertial/mass"), "value") if is_urdf(root) else (body.find("inertial"), "mass")
    return Edit(put(place, name, 1000.0 * float(place.get(name))), body.get("name"))


def placement(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    parents = {inner: outer for outer in root.iter() for inner in outer}
    place, name = (child(joint, "origin"), "xyz") if is_urdf(root) else (parents[joint], "pos")
    step = np.eye(3)[rng.integers(3)] * rng.uniform(1e-4, 5e-2)
    return Edit(put(place, name, numbers(place.get(name, "0 0 0")) + step), joint.get("name"))


def turn(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    joint = pick(moving_joints(root), rng)
    place = child(joint, "origin")
    angles = numbers(place.get("rpy", "0 0 0"))
    angles[rng.integers(3)] += rng.uniform(1e-3, 0.3)
    return Edit(put(place, "rpy", angles), joint.get("name"))


def reversed_axis(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place, name = (child(joint, "axis"), "xyz") if is_urdf(root) else (joint, "axis")
    if place.get(name) is None and not is_urdf(root):
        raise NoPlaceError
    return Edit(put(place, name, -numbers(place.get(name, "1 0 0"))), joint.get("name"))


def damping(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place = child(joint, "dynamics") if is_urdf(root) else joint
    return Edit(put(place, "damping", rng.uniform(0.5, 3.0)), joint.get("name"))


def friction(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    place, name = (child(joint, "dynamics"), "friction") if is_urdf(root) else (joint, "frictionloss")
    return Edit(put(place, name, rng.uniform(0.5, 3.0)), joint.get("name"))


def armature(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    joint = pick(moving_joints(root), rng)
    return Edit(put(joint, "armature", rng.uniform(0.01, 0.3)), joint.get("name"))


def limits(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    joint = pick([j for j in moving_joints(root) if j.find("limit") is not None and j.get("type") != "continuous"], rng)
    place = joint.find("limit")
    return Edit(put(place, "upper", float(place.get("upper", "0")) + rng.uniform(0.01, 0.3)), joint.get("name"))


def fixed(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    mimicked = {mimic.get("joint") for mimic in root.iter("mimic")}
    joint = pick([j for j in moving_joints(root) if j.get("name") not in mimicked], rng)
    joint.set("type", "fixed")
    return Edit("joint made fixed", joint.get("name"))


def missing(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    near = {j.find("parent").get("link") for j in root.iterfind("joint")}
    mimicked = {mimic.get("joint") for mimic in root.iter("mimic")}
    last = [j for j in moving_joints(root) if j.find("child").get("link") not in near and j.get("name") not in mimicked]
    joint = pick(last, rng)
    link = next(k for k in root.iterfind("link") if k.get("name") == joint.find("child").get("link"))
    root.remove(joint)
    root.remove(link)
    return Edit(f"joint and link {link.get('name')} taken out", joint.get("name"))


def mimic(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    one, two = two_of(moving_joints(root), rng)
    ET.SubElement(one, "mimic", joint=two.get("name"), multiplier="0.5")
    return Edit(f"follows {two.get('name')} at 0.5", one.get("name"))


def gravity(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    return Edit(put(child(root, "option"), "gravity", [0.0, 0.0, -9.81 + rng.uniform(1e-3, 0.1)]), "gravity")


# --- edits of content beside rigid bodies


def stiffness(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    joint = pick(moving_joints(root), rng)
    return Edit(put(joint, "stiffness", rng.uniform(0.5, 5.0)), joint.get("name"))


def tendon(what: str) -> Editor:
    def edit(root: ET.Element, rng: np.random.Generator) -> Edit:
        only_mjcf(root)
        joints = [joint.get("name") for joint in two_of(moving_joints(root), rng)]
        fixed = ET.SubElement(child(root, "tendon"), "fixed", name="added", **{what: f"{rng.uniform(1.0, 5.0):.3g}"})
        for joint in joints:
            ET.SubElement(fixed, "joint", joint=joint, coef="1")
        return Edit(f"fixed tendon of {' and '.join(joints)} with {what} {fixed.get(what)}", "added")

    return edit


def option(name: str, value: str, item: str) -> Editor:
    def edit(root: ET.Element, rng: np.random.Generator) -> Edit:
        only_mjcf(root)
        child(root, "option").set(name, value)
        return Edit(f"option {name} {value}", item)

    return edit


def gravcomp(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    body = pick(bodies(root), rng)
    return Edit(put(body, "gravcomp", rng.uniform(0.1, 1.0)), body.get("name"))


def servo(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    motor = pick(root.iterfind("actuator/motor"), rng)
    motor.tag = "position"
    for name in ("gear", "ctrlrange", "forcerange", "ctrllimited", "forcelimited"):
        motor.attrib.pop(name, None)
    motor.set("kp", "100")
    return Edit("motor made a position servo, kp 100", motor.get("name"))


def force_range(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    motor = pick([each for each in child(root, "actuator") if each.get("joint")], rng)
    motor.set("forcelimited", "true")
    return Edit(put(motor, "forcerange", [-0.5, 0.5]), motor.get("name"))


def weld(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    one, two = two_of([body.get("name") for body in bodies(root)], rng)
    ET.SubElement(child(root, "equality"), "weld", name="added", body1=one, body2=two)
    return Edit(f"{one} welded to {two}", "added")


def pair(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_mjcf(root)
    geoms = [geom.get("name") for geom in root.iterfind("worldbody//geom") if geom.get("name")]
    one, two = two_of(geoms, rng)
    ET.SubElement(child(root, "contact"), "pair", geom1=one, geom2=two)
    return Edit(f"contact pair of {one} and {two}", "pair")


def transmission(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    joint = pick(moving_joints(root), rng)
    one = ET.SubElement(root, "transmission", name="added")
    ET.SubElement(one, "type").text = "transmission_interface/SimpleTransmission"
    ET.SubElement(one, "joint", name=joint.get("name"))
    motor = ET.SubElement(one, "actuator", name="added motor")
    ET.SubElement(motor, "mechanicalReduction").text = "50"
    return Edit(f"transmission of {joint.get('name')} with a reduction of 50", "transmission")


def loops_beside(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    name = pick(moving_joints(root), rng).get("name")
    text = f"closed_loop: []\ntype: []\njoint_name: [{name}]\njoint_type: [SPHERICAL]\n"
    return Edit("robot.yaml beside it makes the joint spherical", name, text)


# --- the same said otherwise


def renamed(root: ET.Element, rng: np.random.Generator) -> Edit:
    names = {joint.get("name"): f"j{i}" for i, joint in enumerate(moving_joints(root))}
    for element in root.iter():
        for key in ("name", "joint", "joint1", "joint2"):
            if element.tag not in ("link", "body", "geom", "site") and element.get(key) in names:
                element.set(key, names[element.get(key)])
    return Edit("all moving joints renamed j0, j1 ...")


def reordered(root: ET.Element, rng: np.random.Generator) -> Edit:
    only_urdf(root)
    elements = list(root)
    for element in elements:
        root.remove(element)
    root.extend(elements[int(i)] for i in rng.permutation(len(elements)))
    return Edit("links and joints in another order")


def plain(root: ET.Element, rng: np.random.Generator) -> Edit:
    parents = {inner: outer for outer in root.iter() for inner in outer}
    tags = ("visual", "collision", "gazebo") if is_urdf(root) else ("site",)
    used = {element.get(key) for element in root.iter() for key in ("site", "site1", "site2", "objname", "refsite")}
    gone = [element for element in root.iter() if element.tag in tags and element.get("name") not in used - {None}]
    for element in gone:
        parents[element].remove(element)
    return Edit(f"{len(gone)} elements of {', '.join(tags)} taken out")


def digits(root: ET.Element, rng: np.random.Generator) -> Edit:
    names = ("value", "mass", "xyz", "pos", "ixx", "iyy", "izz")
    places = [(element, name) for element in root.iter() for name in names if element.get(name)]
    for element, name in places:
        words = element.get(name).split()
        element.set(name, " ".join(f"{float(word):.17g}" for word in words))
    return Edit("numbers printed with 17 digits")


PHYSICS: dict[str, Editor] = {
    **{each.__name__.replace("_", " "): each for each in (mass, centre_of_mass, inertia, grams, placement, turn)},
    **{each.__name__.replace("_", " "): each for each in (reversed_axis, damping, friction, armature, limits, fixed)},
    **{each.__name__: each for each in (missing, mimic, gravity)},
}
CONTENT: dict[str, Editor] = {
    "tendon stiffness": tendon("stiffness"),
    "tendon damping": tendon("damping"),
    "tendon friction": tendon("frictionloss"),
    "density": option("density", "1000", "density"),
    "viscosity": option("viscosity", "0.9", "viscosity"),
    "integrator": option("integrator", "RK4", ""),
    "stiffness": stiffness,
    "gravcomp": gravcomp,
    "servo": servo,
    "force range": force_range,
    "weld": weld,
    "contact pair": pair,
    "transmission": transmission,
    "loops beside": loops_beside,
}
SAME: dict[str, Editor] = {"renamed": renamed, "reordered": reordered, "plain": plain, "digits": digits}
#: Content that changes no force at a given motion.
IRRELEVANT = ("integrator",)
KINDS = {**PHYSICS, **CONTENT, **SAME}


def installed(path: str) -> Path:
    """Where a package has a file."""
    found = next((file for entry in sys.path if (file := Path(entry) / path).is_file()), None)
    if found is None:
        sys.exit(f"{path} is not installed: pip install '.[study]'")
    return found


def rows(seed: int, count: int) -> Iterator[dict[str, object]]:
    """One row for each edit, kinds in turn, on models that have a place for them, drawn at random."""
    models = {name: installed(path) for name, path in MODELS.items()}
    trees = {name: ET.parse(path).getroot() for name, path in models.items()}
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        kind = list(KINDS)[number % len(KINDS)]
        for name in rng.permutation(list(MODELS)):
            root = copy.deepcopy(trees[str(name)])
            try:
                edit = KINDS[kind](root, rng)
            except (NoPlaceError, ValueError):
                continue
            yield {"number": number, "model": str(name), "kind": kind} | row(models[str(name)], root, edit, kind)
            break


def row(file: Path, root: ET.Element, edit: Edit, kind: str) -> dict[str, object]:
    """What `diagnose` says of a file and its edited copy."""
    expected = "same" if kind in (*SAME, *IRRELEVANT) else "not same"
    with TemporaryDirectory() as folder:
        b = Path(folder) / f"edited{file.suffix}"
        ET.ElementTree(root).write(b, encoding="unicode")
        if edit.beside:
            (b.parent / "robot.yaml").write_text(edit.beside, encoding="utf-8")
        try:
            found = screwgauge.diagnose(file, b)
        except screwgauge.ScrewgaugeError as error:
            refused = str(error).replace(folder, "").replace(str(file.parent), "")
            return {"edit": edit.what, "expected": expected, "said": "refused", "named": "", "verdict": refused}
    said = " ".join([found.verdict, *(each.sentence for each in found.differences), *found.notes])
    return {
        "edit": edit.what,
        "expected": expected,
        "said": "same" if found.same else "not same",
        "named": edit.item in said if edit.item else "",
        "verdict": found.verdict,
    }


def report(table: pd.DataFrame, said: str) -> str:
    """The table as Markdown."""
    lines = ["# Edits of public arms, hands and legs", "", said, "", "| model | edit | verdict |", "|---|---|---|"]
    for row in table.to_dict("records"):
        cells = (row["model"], f"{row['kind']}: {row['edit']}", f"**{row['said']}.** {row['verdict']}")
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    return "\n".join([*lines, ""])


def main() -> int:
    parser = argparse.ArgumentParser(description="Edits of public models, each put to a diagnosis.")
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    found = []
    for each in rows(options.seed, options.count):
        found.append(each)
        print(f"{each['number']:3} {each['kind']:16} {each['model']:12} {each['said']}", file=sys.stderr)
    table = pd.DataFrame(found)
    wrong = table[(table["expected"] != table["said"]) & (table["said"] != "refused")]
    unnamed = table[table["named"] == False]  # noqa: E712
    said = (
        f"{len(table)} edits: {(wrong['expected'] == 'not same').sum()} called the same that are not, "
        f"{(wrong['expected'] == 'same').sum()} the other way round, {(table['said'] == 'refused').sum()} refused, "
        f"{len(unnamed)} that do not name the part."
    )
    options.out.mkdir(parents=True, exist_ok=True)
    table.to_csv(options.out / "edits.csv", index=False)
    (options.out / "report.md").write_text(report(table, said), encoding="utf-8")
    print(said)
    return int(len(wrong) > 0 or len(unnamed) > 0)


if __name__ == "__main__":
    sys.exit(main())
