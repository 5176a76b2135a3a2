"""Commands of the gate."""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path

from screwgauge.commands import OUT, executor, limits
from screwgauge.commands.carrying import carry_out
from screwgauge.reference.errors import DescriptionError
from screwgauge.report.console import say


def check(options: argparse.Namespace) -> int:
    """Checks scenes and pairs of models; what CI services read of it is left where they look for it."""
    from screwgauge.report.gate import check_with
    from screwgauge.report.pages import check as page
    from screwgauge.study.gate.run import NAME
    from screwgauge.study.gate.store import check_store, keep

    if options.update and options.baseline is None:
        raise DescriptionError("--update does not know what", "check", "name a file by --baseline")
    page.check_files(options)
    if options.store is not None:
        check_store(options.store)
    out, old = options.out or OUT / "check", None if options.update else options.baseline
    more = {"smoke": options.smoke, "tolerances": options.tolerances, "baseline": old}
    execute = executor(options, limits(options))
    found = carry_out(
        page,
        out,
        lambda progress: check_with(execute, options.what, **more, progress=progress, journal=out / NAME),
        tell=(lambda found: found.json) if options.json else None,
        again=NAME,
        inputs=map(Path, options.what),
        force=options.force,
        junit=options.junit,
        baseline=options.baseline if options.update else None,
    )
    if options.store is not None:
        keep(options.store, found.rows, found.smoke)
    for line in found.annotations() if os.environ.get("GITHUB_ACTIONS") and not options.json else ():
        say(line)
    return int(found.exit_status)


def history(options: argparse.Namespace) -> int:
    """Shows the errors and run times that checks have left in a store, or makes a baseline of them."""
    from screwgauge.report.pages.history import PAGE as page
    from screwgauge.study.gate.baseline import check_baseline, write_latest
    from screwgauge.study.gate.store import check_store, history

    store = options.store or OUT / "history"
    check_store(store)
    if options.baseline is not None:
        check_baseline(options.baseline, force=options.force)
    out = options.out or OUT / "history-report"
    carry_out(page, out, lambda progress: history(store, options.scene), force=options.force)
    if options.baseline is not None:
        write_latest(options.baseline, store, options.smoke)
    return 0


def matrix(options: argparse.Namespace) -> int:
    """The check with several versions of the engines; pairs whose rows are there are not checked again."""
    from importlib.metadata import version
    from itertools import product

    from screwgauge.report.pages.matrix import PAGE as page
    from screwgauge.study.matrix import check_versions, matrix

    named = {"pin": options.pin, "mujoco": options.mujoco}
    versions = [check_versions((text or version(package)).split(","), package) for package, text in named.items()]
    out, pairs = options.out or OUT / "matrix", [(pin, mujoco) for pin, mujoco in product(*versions)]
    asked = partial(matrix, pairs, out / page.NAME, execute=executor(options))
    found = carry_out(page, out, lambda progress: asked(progress=progress), again=page.NAME, force=options.force)
    statuses = {*found["status"]}
    return 0 if statuses == {"agree"} else 1 if statuses <= {"agree", "differ"} else 3
