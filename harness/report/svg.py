"""Pictures inside a page."""

from __future__ import annotations

import re
from html import escape


def inline(svg: str, prefix: str, label: str) -> str:
    """The picture for use inside a page: ids of its own, and a label for screen readers."""
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    svg = svg.replace("url(#", f"url(#{prefix}-")
    return svg.replace("<svg ", f'<svg role="img" aria-label="{escape(label)}" ', 1).strip()
