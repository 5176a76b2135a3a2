"""Imports URDF, MJCF, SDF and USD files as descriptions."""

from __future__ import annotations

from pathlib import Path

#: Suffixes of USD files; suffixes of all model files.
USD = (".usd", ".usda", ".usdc", ".usdz")
SUFFIXES = (".urdf", ".xml", ".mjcf", ".sdf", ".world", *USD)
#: Entry of ``allow`` that permits computing mass and inertia from meshes.
MESHES = "meshes"
#: Suffixes of files from which models are generated; they are recognised so that the error message can say so.
SOURCES = (".xacro",)


def is_model(path: Path | str) -> bool:
    """Return True if a name has the suffix of a model file."""
    return str(path).lower().endswith((*SUFFIXES, *SOURCES))
