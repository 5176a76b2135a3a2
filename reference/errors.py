"""What goes wrong, said in one sentence: what, where, what to do."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class ScrewgaugeError(Exception):
    """Base of every error that a user can cause or mend.

    Args:
        what: What is wrong, with value and limit.
        where: File and entry, or time and pose.
        remedy: What to do about it.
    """

    def __init__(self, what: str, where: str, remedy: str) -> None:
        super().__init__(f"{where}: {what}; {remedy}." if where else f"{what}; {remedy}.")
        self.what, self.where, self.remedy = what, where, remedy


class DescriptionError(ScrewgaugeError):
    """A TOML file that does not describe a mechanism or a scene."""


class UnknownNameError(ScrewgaugeError):
    """A scene, mechanism, engine, quantity or key that does not exist."""

    def __init__(self, kind: str, name: str, known: Iterable[str], where: str = "") -> None:
        names = list(known)
        near = get_close_matches(name, names, n=1)
        hint = f"did you mean '{near[0]}'?" if near else "choose one of these"
        super().__init__(f"unknown {kind} '{name}'", where, f"{hint} Known: {', '.join(names)}")


class ClosureError(ScrewgaugeError):
    """A loop that cannot close."""


class SingularPoseError(ScrewgaugeError):
    """A pose where the motion is not determined by the independent coordinates."""


class JointLimitError(ScrewgaugeError):
    """A motion beyond a joint limit of the description."""


class ModelFileError(ScrewgaugeError):
    """A URDF, MJCF or loops file that an engine cannot use."""


class OutputError(ScrewgaugeError):
    """A folder that cannot be written."""
