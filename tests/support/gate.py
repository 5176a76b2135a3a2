"""The gate of a repository: items, rows, baseline and store."""

from __future__ import annotations

from screwgauge.judging.residual import Residual
from screwgauge.report.gate import PAGE, told
from screwgauge.study.executors import Processes
from screwgauge.study.gate import run as gate_run
from screwgauge.study.gate.baseline import against, write_baseline, write_latest
from screwgauge.study.gate.items import Item, items
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.gate.row import GateRow, row_from
from screwgauge.study.gate.run import NAME, check_items
from screwgauge.study.gate.store import history, keep
from screwgauge.study.table import rows_in
