"""Commands and options that ended, and where what they did is now."""

from __future__ import annotations

from collections.abc import Sequence

from screwgauge.reference.errors import DescriptionError

_CAMPAIGN = "run pytest -m campaign -k {} in a checkout, see reports/README.md"
_PAPER = "run pytest tests/paper --reports=DIR in a checkout, see reports/README.md"
#: Command, or command and option -> what to type in its place.
ENDED = {
    "bench --random": _CAMPAIGN.format("random"),
    "check --self-test": _CAMPAIGN.format("alarms"),
    "diagnose --self-test": _CAMPAIGN.format("selftest"),
    "paper": _PAPER,
    "run --errata": _PAPER,
}


def check_current(arguments: Sequence[str]) -> None:
    """Refuses what ended, before it is called unknown.

    Raises:
        DescriptionError: It is in `ENDED`.
    """
    command, *rest = arguments or [""]
    options = [argument.partition("=")[0] for argument in rest]
    for typed in (command, *(f"{command} {option}" for option in options)):
        if typed in ENDED:
            raise DescriptionError("is no longer part of the package", typed, ENDED[typed])
