"""The report in Markdown: verdict first, evidence after. Formats, never computes."""

from __future__ import annotations

from collections.abc import Sequence

from screwgauge.report import sections
from screwgauge.report.formatting import cell
from screwgauge.report.forward import published
from screwgauge.report.guard import guard_section
from screwgauge.report.plots import Plot
from screwgauge.report.prose import HOW, INTEGRATED, INTEGRATED_LIMITATIONS, LIMITATIONS
from screwgauge.report.verdict import verdict
from screwgauge.study.results import Results


def report_markdown(results: Results, plots: Sequence[Plot], paper: str = "") -> str:
    """The text of ``report.md``; plots are linked as ``plots/NAME.svg``.

    Args:
        paper: The section "The paper, checked", left out if empty.
    """
    found, others, given = verdict(results), published(results), results.scene.forward is None
    parts = [
        f"# {cell(results.scene.title or results.scene.name)}: verification report",
        f"> **{found.word}** {cell(found.sentence)}",
        *(f"> **Warning:** {cell(sentence)}" for sentence in results.warnings),
        sections.overview(results),
        "## Scene",
        sections.scene(results),
        "## Engines",
        sections.engines(results),
        "## Pairs",
        sections.pairs(results),
        "## Judge",
        "Residuals of the equations themselves, engine by engine; no second engine is needed.",
        sections.judge(results),
        "## Guard",
        guard_section(results),
        "## Plots",
        _plots(plots, len(results.solutions)),
        "## Mechanism",
        sections.facts(results.mobility, "No facts of the mechanism were computed."),
        *(["## The paper, checked", paper] if paper else []),
        *(["## Published results", others] if others else []),
        "## How it was compared",
        HOW if given else INTEGRATED,
        "## Run times",
        sections.timings(results),
        "## Environment",
        sections.facts(results.environment, "Not recorded."),
        "## Known limitations",
        "\n".join(f"- {sentence}" for sentence in (LIMITATIONS if given else INTEGRATED_LIMITATIONS)),
    ]
    return "\n\n".join(parts) + "\n"


def _plots(plots: Sequence[Plot], n_engines: int) -> str:
    if not plots:
        return "Nothing to draw."
    pictures = [f"![{cell(plot.title)}](plots/{plot.name}.svg)" for plot in plots]
    lead = (
        "Above: the first engine as lines, the others as sparse marks in its colours. Below: for each pair "
        "the largest difference over the components of the panel, with the tolerance where it is one for all."
    )
    return "\n\n".join([lead, *pictures] if n_engines > 1 else pictures)
