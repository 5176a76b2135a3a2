"""Scripts of others that a page carries, so that it opens offline: vega, which draws charts, and meshcat for space."""

from __future__ import annotations

from importlib.metadata import distribution, version
from pathlib import Path

import numpy as np

from screwgauge.report.figures.renderer import RENDERER
from screwgauge.truth import cache

STAGE = Path(__file__).with_name("stage") / "stage.js"


def chart() -> str:
    """vega, vega-lite and vega-embed; making them takes seconds, so they are kept in the user's cache folder."""
    release = version("vl-convert-python")
    key = cache.digest("vega", release)
    kept, _ = cache.read(key, release)  # whole and ours, or computed anew
    if kept is not None:
        return kept["script"].tobytes().decode()
    script = str(RENDERER.ask("javascript_bundle"))
    cache.write(key, release, {"script": np.frombuffer(script.encode(), dtype=np.uint8)})
    return script


def stage() -> str:
    """meshcat's viewer with three.js, and what draws a mechanism with it; its Python would bring a server, so not."""
    viewer = Path(str(distribution("meshcat").locate_file("meshcat/viewer/dist/main.min.js")))
    return f"{viewer.read_text(encoding='utf-8')}\n;{STAGE.read_text(encoding='utf-8')}"
