"""Pages: their blocks, and these as text, Markdown and HTML."""

from screwgauge.report.blocks import (
    LONG,
    Banner,
    Block,
    Group,
    Items,
    Marked,
    Picture,
    Table,
    Text,
    facts,
    table,
    walk,
)
from screwgauge.report.html import fragment, page, stage_script, three_js
from screwgauge.report.layout import Report, prose
from screwgauge.report.text import markdown, terminal
from screwgauge.study.formatting import file_name, number, size
