"""The gate of a repository: items, rows and baseline."""

from screwgauge.judging.residual import Residual
from screwgauge.report.pages.check import PAGE, sentence_of
from screwgauge.study import address as address_module
from screwgauge.study.address import address
from screwgauge.study.gate import run as gate_run
from screwgauge.study.gate.baseline import compare_baseline, write_baseline
from screwgauge.study.gate.items import GateRow, Item
from screwgauge.study.gate.measure import GateSettings
from screwgauge.study.gate.run import check_items, files_in
from screwgauge.study.runner import Processes
from screwgauge.study.store import from_record, is_record
