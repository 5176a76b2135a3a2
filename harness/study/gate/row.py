"""What a gate finds of one scene, or of one pair of models: plain data, which pickles and goes through JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Literal

from screwgauge.judging.residual import JUDGE, Residual

Status = Literal["agree", "judged", "unread", "differ", "failed", "refused"]
#: Exit status of the command by what became of a row; the highest of all rows counts.
EXIT: dict[Status, int] = {"agree": 0, "judged": 0, "unread": 1, "differ": 1, "refused": 2, "failed": 3}


@dataclass(frozen=True, slots=True)
class GateRow:
    """A scene or a pair of models.

    Attributes:
        scene: Its name; of a pair, ``A.urdf - B.xml``.
        status: ``agree``; ``judged`` (the equations hold for each engine, and no two were compared); ``unread`` (the
            scene names files that nobody read, and the rest agrees); ``differ``; ``failed`` (an engine, or its
            process); ``refused`` (bad input).
        sentence: What was found, with the cause where one is known.
        errors: One for each quantity, pair and unit.
        coverage: What the motion tests, in a sentence.
        versions: Of engines, by name; `files`: file -> SHA-256.
        doubts: Sentences on numbers that no machine has, whatever the status.
        file, line: Where to look for the cause; 0 if no line is known.
        unread: What the scene names and nobody read, in sentences.
        read: Files that were read, by the names that were given.
    """

    scene: str
    status: Status
    sentence: str
    errors: Sequence[Residual] = ()
    coverage: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    file: str = ""
    line: int = 0
    seconds: float = 0.0
    doubts: Sequence[str] = ()
    unread: Sequence[str] = ()
    read: Sequence[str] = ()

    @property
    def ok(self) -> bool:
        """Whether it passes."""
        return EXIT[self.status] == 0

    @property
    def worst(self) -> Residual | None:
        """The largest error by its tolerance; those that are out of it first, and those of two engines."""
        return max(self.errors, key=lambda one: (not one.ok, one.b != JUDGE, one.share), default=None)


#: Types of fields -> what JSON makes of them.
_PLAIN: dict[str, type | tuple[type, ...]] = {
    "str": str,
    "bool": bool,
    "bool | None": bool,
    "int": int,
    "float": (int, float),
    "Status": str,
    "Sequence[str]": list,
    "Sequence[Residual]": list,
    "Mapping[str, str]": dict,
    "tuple[float, float]": list,
}


def row_from(record: object) -> GateRow:
    """A row from what `dataclasses.asdict` made of it, which may have been on disk since.

    Raises:
        ValueError: It is no row.
    """
    said = _fields(GateRow, record)
    errors = [_fields(Residual, one) for one in said.pop("errors", ())]
    texts = [
        *said.get("unread", ()),
        *said.get("read", ()),
        *(x for key in ("versions", "files") for x in said.get(key, {}).values()),
    ]
    numbers = [x for one in errors for x in one.get("values", ())]
    pairs = all(len(one.get("values", "ab")) == 2 for one in errors)
    sound = pairs and all(isinstance(x, str) for x in texts) and all(isinstance(x, int | float) for x in numbers)
    if not sound or said.get("status") not in EXIT:
        raise ValueError("is no row")
    made = [Residual(**{**one, "values": tuple(one["values"])} if "values" in one else one) for one in errors]
    return GateRow(**{**said, "errors": tuple(made)})


def _fields(kind: type[GateRow | Residual], record: object) -> dict[str, Any]:
    """Fields of a class, each of its type; a ValueError if the record has others or lacks some."""
    every = {field.name: field for field in fields(kind)}
    needed = {name for name, one in every.items() if one.default is MISSING and one.default_factory is MISSING}
    if not isinstance(record, dict) or record.keys() - every.keys() or needed - record.keys():
        raise ValueError(f"is no {kind.__name__}")
    if not all(isinstance(value, _PLAIN[str(every[name].type)]) for name, value in record.items()):
        raise ValueError(f"is no {kind.__name__}")
    return dict(record)
