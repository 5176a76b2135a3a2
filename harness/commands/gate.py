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


def matrix(options: argparse.Namespace) -> int:
    """The check with several versions of the engines; pairs whose rows are there are not checked again."""
    from importlib.metadata import version
    from itertools import product

    from screwgauge.report.pages import matrix as page
    from screwgauge.study.matrix import check_versions, matrix

    asked = {"pin": options.pin, "mujoco": options.mujoco}
    versions = [check_versions((text or version(package)).split(","), package) for package, text in asked.items()]
    out, pairs = options.out or OUT / "matrix", [(pin, mujoco) for pin, mujoco in product(*versions)]
    found = carry_out(page, out, lambda progress: matrix(pairs, out / page.NAME, progress=progress), again=page.NAME)
    statuses = {*found["status"]}
    return 0 if statuses == {"agree"} else 1 if statuses <= {"agree", "differ"} else 3
