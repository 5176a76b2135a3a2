"""Commands of the gate."""

from __future__ import annotations

import argparse
import os

from screwgauge.commands import OUT, carry_out, limits
from screwgauge.reference.errors import DescriptionError
from screwgauge.report.console import say


def check(options: argparse.Namespace) -> int:
    """Checks scenes and pairs of models; what CI services read of it is left where they look for it."""
    from screwgauge.report.gate import check
    from screwgauge.report.pages import check as page
    from screwgauge.study.gate.run import NAME

    if options.update and options.baseline is None:
        raise DescriptionError("--update does not know what", "check", "name a file by --baseline")
    if options.jobs < 1:
        raise DescriptionError(f"{options.jobs} scenes at a time", "-j", "give a positive number")
    page.check_files(options)
    out, old = options.out or OUT / "check", None if options.update else options.baseline
    more = {"smoke": options.smoke, "tolerances": options.tolerances, "baseline": old, "jobs": options.jobs}
    found = carry_out(
        page,
        out,
        lambda progress: check(*options.what, **more, limits=limits(options), progress=progress, journal=out / NAME),
        tell=(lambda found: found.json) if options.json else None,
        again=NAME,
        junit=options.junit,
        baseline=options.baseline if options.update else None,
    )
    for line in found.annotations() if os.environ.get("GITHUB_ACTIONS") and not options.json else ():
        say(line)
    return int(found.exit_status)
