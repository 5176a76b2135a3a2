"""User errors, whose messages state the fault, the place and the remedy in one sentence, and helpers for messages."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from numbers import Integral
from typing import Any

#: Invisible characters that count as letters or marks: names that differ only in these look alike.
_CODES = {0x034F, 0x115F, 0x1160, 0x17B4, 0x17B5, 0x2800, 0x3164, 0xFFA0}
_CODES |= {*range(0x180B, 0x1810), *range(0xFE00, 0xFE10), *range(0xE0100, 0xE01F0)}
_UNSEEN = frozenset(map(chr, _CODES))
#: Prefixes of commands to a CI service; a space after the prefix disables the command.
_OBEYED = re.compile(r"^ *:(?=:)|#(?=#(?:vso)?\[)", re.MULTILINE)


def printable(text: str, *, lines: bool = False) -> str:
    """Replace control characters, invisible characters and characters that are illegal in XML with a space.

    Args:
        lines: Keep line breaks.
    """
    if lines and not _is_printable(text.replace("\n", "")):
        return "\n".join(map(printable, text.split("\n")))
    if lines or _is_printable(text):
        return text
    return "".join(sign if sign.isprintable() and sign not in _UNSEEN else " " for sign in text)


def _is_printable(text: str) -> bool:
    return text.isprintable() and (text.isascii() or _UNSEEN.isdisjoint(text))


def log_text(text: str) -> str:
    """Make lines printable and escape commands to a CI service that reads the log.

    GitHub executes lines that begin with ``::`` or contain ``##[``; Azure executes lines that contain ``##vso[``.
    """
    return _OBEYED.sub(r"\g<0> ", printable(text, lines=True))


def first_few(things: Iterable[str], most: int, between: str = ", ") -> str:
    """List the first items and the number of remaining items: ``a, b and 3 more``, or ``a; b; and 3 more``."""
    named = list(things)
    rest = len(named) - most
    return between.join(named[:most]) + (f"{between.rstrip(', ')} and {rest} more" if rest > 0 else "")


#: Largest number of names that a message lists in full, and number of similar names that it lists if there are more.
LISTED, NEAREST = 30, 6
#: Largest number of characters of a value that a message quotes.
QUOTED = 60


def quote(value: object) -> str:
    """Quote a user's value on one line with at most `QUOTED` characters."""
    try:
        text = printable(repr(value))
    except Exception:  # Python refuses to print huge integers; the repr of a foreign object may raise anything
        text = f"a value of type {type(value).__name__} that cannot be printed"
    start = QUOTED * 2 // 3
    return text if len(text) <= QUOTED else f"{text[:start]}...{text[start + 3 - QUOTED :]}"


class ScrewgaugeError(Exception):
    """Base class of all errors that a user can cause or fix.

    Args:
        what: Fault, with value and limit.
        where: File and entry, or time and pose.
        remedy: What the user can do.
    """

    exit_status = 2  #: Exit status of a command that fails with this error.

    def __init__(self, what: str, where: str, remedy: str) -> None:
        what, where, remedy = _one_line(what, 400), _one_line(where, 1000), _one_line(remedy, 2000)
        super().__init__(f"{where}: {what}; {remedy}." if where else f"{what}; {remedy}.")
        self.what, self.where, self.remedy = what, where, remedy

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the error unmodified, because subclasses have different constructor arguments."""
        return Exception.__new__, (type(self), str(self)), vars(self)


def _one_line(text: str, most: int) -> str:
    """Shorten a message to one line, however long the quoted values are."""
    text = " ".join(printable(text).split())
    return text if len(text) <= most else f"{text[: most - 3]}..."


class DescriptionError(ScrewgaugeError):
    """Raised for a TOML file that does not describe a mechanism or scene."""


class UnknownNameError(ScrewgaugeError):
    """Raised for an unknown scene, mechanism, engine, quantity or key."""

    def __init__(self, kind: str, name: object, known: Iterable[str], where: str = "", besides: str = "") -> None:
        names, besides = list(known), besides and f", or {besides}"
        text = name[:100] if isinstance(name, str) else ""
        near = get_close_matches(text, names, n=1)
        hint = f"did you mean '{near[0]}'? Known: " if near else "choose one of: " if names else "none exist"
        few = names if len(names) <= LISTED else [*get_close_matches(text, dict.fromkeys(names), NEAREST, 0.0), *names]
        listed = first_few(dict.fromkeys(few), NEAREST if len(names) > LISTED else LISTED)
        super().__init__(f"unknown {kind} {quote(name)}", where, hint + listed + besides)


#: System libraries that packages need but do not include: start of the file name -> Debian and Ubuntu package.
_SYSTEM = {"libGL.so": "libgl1", "libEGL.so": "libegl1", "libOSMesa.so": "libosmesa6", "libX11.so": "libx11-6"}


def remedy_of_import(error: ImportError, package: str) -> str:
    """Return the remedy for a failed import: the package to install."""
    for name in (name for name in _SYSTEM if name in str(error)):
        return f"{name.partition('.')[0]} is a system library; on Debian or Ubuntu, run apt-get install {_SYSTEM[name]}"
    return f"pip install {'' if isinstance(error, ModuleNotFoundError) else '--force-reinstall '}{package}"


def check_seed(seed: object) -> None:
    """Reject an invalid random seed.

    Raises:
        DescriptionError: The seed is not a non-negative integer.
    """
    if not (isinstance(seed, Integral) and int(seed) >= 0):
        raise DescriptionError(f"{quote(seed)} is not a seed", "seed", "use a whole number, 0 or larger")


def check_choice(kind: str, names: object, known: Iterable[str], where: str = "") -> list[str]:
    """Return the names as a list; reject unknown names and an empty list.

    Raises:
        ScrewgaugeError: `names` is not a list, is empty, or has an unknown name.
    """
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise DescriptionError(f"{quote(names)} is not a list of names", where or f"{kind} names", "write a list")
    wanted, choice = list(names), list(known)
    for name in wanted:
        if name not in choice:
            raise UnknownNameError(kind, name, choice, where)
    if not wanted:
        raise DescriptionError(f"no {kind} is chosen", where, f"choose at least one of: {', '.join(choice)}")
    return wanted


class ClosureError(ScrewgaugeError):
    """Raised when a loop cannot close."""


class SingularPoseError(ScrewgaugeError):
    """Raised at a pose where the independent coordinates do not determine the motion."""


class JointLimitError(ScrewgaugeError):
    """Raised when a motion exceeds a joint limit of the description."""


class ModelFileError(ScrewgaugeError):
    """Raised for a URDF, MJCF or loops file that an engine cannot use."""


class LoaderError(ScrewgaugeError):
    """Raised when a model file makes a library crash, hang or exhaust memory."""

    exit_status = 3


class OutputError(ScrewgaugeError):
    """Raised for a directory or stream that cannot be written."""


class ReportError(ScrewgaugeError):
    """Raised when report pages cannot be created although the results are available."""

    exit_status = 3
