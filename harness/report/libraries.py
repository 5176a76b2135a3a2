"""Scripts of others that a page carries, so that it opens offline: vega draws charts, three.js draws in space."""

from __future__ import annotations

import re
from importlib.metadata import distribution, version
from pathlib import Path
from zipfile import ZipFile

import numpy as np

from screwgauge.report.figures.renderer import RENDERER
from screwgauge.truth import cache

STAGE = Path(__file__).with_name("stage") / "stage.js"
#: three.js within trimesh's viewer: from the head of its licence to the end of the function that defines it.
THREE = re.compile(
    r"/\*\*\s*\* @license\s*\* Copyright \S+ Three\.js Authors.*?\}\)\s*\)\s*;?(?=\n|</script>)", re.DOTALL
)
#: three.js names its licence only; this is the text that has to go with every copy.
LICENCE = """/*! three.js. The MIT License. Copyright © 2010-2022 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit
persons to whom the Software is furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
*/"""


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
    """three.js with its licence, and what draws a mechanism with it.

    Where the installed trimesh carries no three.js, the script says so on the page's console and the still picture
    stays.
    """
    if three := three_js():
        return f"{LICENCE}\n{three}\n{STAGE.read_text(encoding='utf-8')}"
    reason = f"no picture in space: trimesh {version('trimesh')} carries no three.js where 5.2 does"
    return f"window.screwgaugeStage = () => {{ throw new Error({reason!r}); }};"


def three_js() -> str:
    """three.js as trimesh's viewer carries it, empty if it does not; trimesh itself is not imported."""
    archive = viewer_archive()
    if not archive.is_file():
        return ""
    with ZipFile(archive) as viewer:
        pages = [viewer.read(name).decode() for name in viewer.namelist() if name.endswith(".html.template")]
    found = [match[0] for match in map(THREE.search, pages) if match]
    return found[0] if found else ""


def viewer_archive() -> Path:
    """The viewer of the installed trimesh, a page in an archive."""
    return Path(str(distribution("trimesh").locate_file("trimesh/resources/templates/viewer.zip")))
