"""A method: an engine with its settings, which can be put to any problem. Data only; it pickles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from screwgauge.engines.registry import Model, get_engine
from screwgauge.problem import ModelFiles


@dataclass(frozen=True, slots=True)
class Method:
    """An engine with settings.

    Attributes:
        engine: Its name in the registry.
        settings: See the engine's folder.
        label: What rows call it; the engine's name if empty.
    """

    engine: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    @property
    def name(self) -> str:
        """What rows call it."""
        return self.label or self.engine

    def load(self, files: ModelFiles) -> Model:
        """Loads a model file with the settings.

        Raises:
            ImportError: The engine's package is not installed.
            ScrewgaugeError: The file cannot be loaded.
        """
        return get_engine(self.engine).load(files, **self.settings)
