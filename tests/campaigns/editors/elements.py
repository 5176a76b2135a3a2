import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from campaigns.corpus.parts import NoPlaceError

T = TypeVar("T")


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


def check_place(there: bool) -> None:
    if not there:
        raise NoPlaceError


def of_urdf(edit: Editor) -> Editor:
    def checked(root: ET.Element, rng: np.random.Generator) -> Edit:
        check_place(is_urdf(root))
        return edit(root, rng)

    return checked


def of_mjcf(edit: Editor) -> Editor:
    def checked(root: ET.Element, rng: np.random.Generator) -> Edit:
        check_place(not is_urdf(root))
        return edit(root, rng)

    return checked


def two_of(some: Sequence[T], rng: np.random.Generator) -> list[T]:
    """Two of them."""
    check_place(len(some) > 1)
    return [some[int(i)] for i in rng.permutation(len(some))[:2]]


def is_urdf(root: ET.Element) -> bool:
    return root.tag == "robot"


def numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def put(element: ET.Element, name: str, values: np.ndarray | list[float]) -> str:
    old = element.get(name, "none")
    element.set(name, " ".join(f"{value:.9g}" for value in np.atleast_1d(values)))
    return f"{name} {old} -> {element.get(name)}"


def moving_joints(root: ET.Element) -> list[ET.Element]:
    if is_urdf(root):
        kinds = ("revolute", "continuous", "prismatic")
        return [j for j in root.iterfind("joint") if j.get("type") in kinds and j.find("mimic") is None]
    return [j for j in root.iterfind("worldbody//joint") if j.get("name") and j.get("type", "hinge") != "ball"]


def bodies(root: ET.Element) -> list[ET.Element]:
    if is_urdf(root):
        moved = {j.find("child").get("link") for j in root.iterfind("joint") if j.get("type") != "fixed"}
        links = [link for link in root.iterfind("link") if link.get("name") in moved]
        return [k for k in links if k.find("inertial/mass") is not None and float(k.find("inertial/mass").get("value"))]
    own = [body for body in root.iterfind("worldbody//body") if body.find("joint") is not None]
    return [body for body in own if body.find("inertial") is not None]
