"""Campaigns: what tests the product at large and writes a report of it, on request.

pytest -m campaign --reports=reports                       # all of them, as many rows as a report is kept with
pytest -m campaign -k random --count 50 --reports=DIR      # one of them, smaller, elsewhere

With a blank in place of ``=``, pytest takes a folder that is there for one of tests.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from campaigns.rows import rows_of_mechanisms

from screwgauge.commands.execution import carry_out
from screwgauge.study import isolation
from screwgauge.study.cluster import executor
from screwgauge.study.runner import Executor
from screwgauge.truth import cache

#: Before tests put others in their places, see the fixtures `here` and `cache`.
IN_PROCESSES = isolation.run_isolated
CACHE = os.environ.get(cache.VARIABLE)


@dataclass(frozen=True)
class Campaign:
    """How large a campaign is to be, and where its report goes.

    Attributes:
        count: Rows asked for by ``--count``, None for those that the kept report has.
        reports: Folder of all reports: that of ``--reports``, else one that goes away.
        execute: Where rows are made: two processes, or the cluster of ``--cluster``.
        models: Folders of models, those of ``--models``.
    """

    count: int | None
    reports: Path
    execute: Executor
    models: tuple[Path, ...] = ()

    def carry_out(self, page: Any, name: str, work: Callable[[Any], Any], again: bool = False) -> Any:
        """Works and writes the report ``reports/NAME``; returns what was found.

        Args:
            page: Its `Report`.
            work: Takes the progress, ``(step, share)``.
            again: A later run does not make the rows again that were made.
        """
        return carry_out(page, self.reports / name, work, again=again, force=True)

    def of_mechanisms(
        self,
        page: Any,
        name: str,
        work: Callable[[tuple[int, str]], dict[str, Any]],
        columns: Sequence[str],
        usual: int,
    ) -> pd.DataFrame:
        """A row of each random mechanism, `usual` of them by default, in the report ``reports/NAME``."""
        count, file = self.count or usual, self.reports / name / page.NAME
        return self.carry_out(
            page, name, lambda show: rows_of_mechanisms(count, file, work, columns, show, self.execute), again=True
        )


@pytest.fixture
def campaign(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Campaign:
    """What the command line asks of a campaign. Its engines run in processes of their own: those of users do."""
    monkeypatch.setattr(isolation, "run_isolated", IN_PROCESSES)
    # rows are kept in the user's own cache
    monkeypatch.delenv(cache.VARIABLE) if CACHE is None else monkeypatch.setenv(cache.VARIABLE, CACHE)
    option = request.config.getoption
    reports = (option("--reports") or tmp_path).absolute()
    return Campaign(option("--count"), reports, executor(2, option("--cluster")), tuple(option("--models")))
