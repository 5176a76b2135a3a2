"""The result of `screwgauge.diagnose`: a diagnosis that can be written and shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from screwgauge.diagnosis.answer import Diagnosis
from screwgauge.report.write import Shown

if TYPE_CHECKING:
    from screwgauge.report.layout import Report


class DiagnosisReport(Shown, Diagnosis):
    """A diagnosis with its report, which notebooks display."""

    __slots__ = ()

    def _report(self) -> Report:
        """Return the report; its pages and figures are imported only here, to save a tenth of a diagnosis's time."""
        from screwgauge.report.pages.diagnosis import PAGE

        return PAGE
