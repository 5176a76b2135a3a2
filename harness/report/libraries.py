"""Scripts of others that a page carries, so that it opens offline: vega, which draws charts, and meshcat for space."""

from __future__ import annotations

import logging
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

import numpy as np

from screwgauge.truth import cache

STAGE = Path(__file__).with_name("stage") / "stage.js"


def chart() -> str:
    """vega, vega-lite and vega-embed; making them takes seconds, so they are kept in the user's cache folder."""
    import vl_convert

    release = version("vl-convert-python")
    key = cache.digest("vega", release)
    kept, _ = cache.read(key, release)  # whole and ours, or computed anew
    if kept is not None:
        return kept["script"].tobytes().decode()
    logging.getLogger("swc_ecma_transforms_optimization").setLevel(logging.CRITICAL)  # it calls its passes errors
    bundle: Any = vl_convert.javascript_bundle  # its types ask for what is optional
    script = str(bundle())
    cache.write(key, release, {"script": np.frombuffer(script.encode(), dtype=np.uint8)})
    return script


def stage() -> str:
    """meshcat's viewer with three.js, and what draws a mechanism with it; its Python would bring a server, so not."""
    viewer = Path(str(distribution("meshcat").locate_file("meshcat/viewer/dist/main.min.js")))
    return f"{viewer.read_text(encoding='utf-8')}\n;{STAGE.read_text(encoding='utf-8')}"
