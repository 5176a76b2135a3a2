import xml.etree.ElementTree as ET

import numpy as np
from campaigns.editors.elements import Edit, Editor, is_urdf, moving_joints, of_urdf


def renamed(root: ET.Element, rng: np.random.Generator) -> Edit:
    names = {joint.get("name"): f"j{i}" for i, joint in enumerate(moving_joints(root))}
    for element in root.iter():
        for key in ("name", "joint", "joint1", "joint2"):
            if element.tag not in ("link", "body", "geom", "site") and element.get(key) in names:
                element.set(key, names[element.get(key)])
    return Edit("all moving joints renamed j0, j1 ...")


@of_urdf
def reordered(root: ET.Element, rng: np.random.Generator) -> Edit:
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


FORMS: dict[str, Editor] = {"renamed": renamed, "reordered": reordered, "plain": plain, "digits": digits}
