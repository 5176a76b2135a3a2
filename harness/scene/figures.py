"""What a figure of a report shows; a scene may say it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """Curves of one quantity and unit, in panels side by side.

    Attributes:
        panels: Label and the patterns (``leg1.*``) of the components of each panel.
    """

    title: str
    quantity: str
    unit: str
    panels: tuple[tuple[str, tuple[str, ...]], ...]
