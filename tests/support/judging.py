"""How answers are compared, judged and flagged."""

from __future__ import annotations

from screwgauge.judging.answer import answer_at
from screwgauge.judging.charts import in_one_chart
from screwgauge.judging.compare import compare
from screwgauge.judging.conditioning import LIMIT, flagged
from screwgauge.judging.coverage import NOTHING, coverage
from screwgauge.judging.exerted import held as exerted
from screwgauge.judging.judge import judge
from screwgauge.study.reference import Reference, reference_values, score
