"""Commands and options that ended or have another name, and what to type in their place."""

from __future__ import annotations

from collections.abc import Sequence

from screwgauge.reference.errors import DescriptionError

_CAMPAIGN = "run pytest -m campaign -k {} in a checkout, see reports/README.md"
_PAPER = "run pytest tests/paper --reports=DIR in a checkout, see reports/README.md"
_ENDED, _RENAMED = "is no longer part of the package", "has another name"
#: Command, or command and option -> what became of it, and what to type in its place.
ENDED = {
    "bench --budget": (_RENAMED, "write bench --limit SECONDS"),
    "bench --random": (_ENDED, _CAMPAIGN.format("random")),
    "check --self-test": (_ENDED, _CAMPAIGN.format("alarms")),
    "diagnose --case": (_RENAMED, "write casebook ID"),
    "diagnose --self-test": (_ENDED, _CAMPAIGN.format("selftest")),
    "paper": (_ENDED, _PAPER),
    "run --errata": (_ENDED, _PAPER),
}


def check_current(arguments: Sequence[str]) -> None:
    """Refuses what ended or has another name, before it is called unknown.

    Raises:
        DescriptionError: It is in `ENDED`.
    """
    command, *rest = arguments or [""]
    options = [argument.partition("=")[0] for argument in rest]
    for typed in (command, *(f"{command} {option}" for option in options)):
        if typed in ENDED:
            what, instead = ENDED[typed]
            raise DescriptionError(what, typed, instead)
