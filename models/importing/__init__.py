"""Makes descriptions of URDF, MJCF, SDF and USD files."""

from __future__ import annotations

from pathlib import Path

#: How the names of model files end; those of USD.
USD = (".usd", ".usda", ".usdc", ".usdz")
SUFFIXES = (".urdf", ".xml", ".mjcf", ".sdf", ".world", *USD)
#: Entry of ``allow`` by which mass and inertia are computed from meshes.
MESHES = "meshes"
#: And those of files from which models are made: who names one is told so.
SOURCES = (".xacro",)


def is_model(path: Path | str) -> bool:
    """True if the ending of a name is one of model files."""
    return str(path).lower().endswith((*SUFFIXES, *SOURCES))
