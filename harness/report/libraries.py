"""Scripts of others that a page carries, so that it opens offline: vega, which draws charts, and meshcat for space."""

from __future__ import annotations

from importlib.metadata import version
from importlib.resources import files

import numpy as np

from screwgauge.truth import cache


def chart() -> str:
    """vega, vega-lite and vega-embed; making them takes seconds, so they are kept in the user's cache folder."""
    import vl_convert

    release = version("vl-convert-python")
    kept, _ = cache.read("vega", release)  # whole, or computed anew
    if kept is not None:
        return kept["script"].tobytes().decode()
    script = str(vl_convert.javascript_bundle())
    cache.write("vega", release, {"script": np.frombuffer(script.encode(), dtype=np.uint8)})
    return script


def stage() -> str:
    """meshcat's viewer with three.js, and what draws a mechanism with it."""
    viewer = files("meshcat") / "viewer" / "dist" / "main.min.js"
    own = files("screwgauge.report") / "stage" / "stage.js"
    return f"{viewer.read_text(encoding='utf-8')}\n;{own.read_text(encoding='utf-8')}"
