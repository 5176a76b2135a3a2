"""The command that shows a mechanism: in the browser, or as a picture."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from screwgauge.commands import import_named
from screwgauge.reference.errors import DescriptionError, OutputError, ScrewgaugeError, UnknownNameError
from screwgauge.reference.outputs import check_free, save_file
from screwgauge.report.console import complain, is_stopped, say

if TYPE_CHECKING:
    from screwgauge.reference.mechanism import Mechanism
    from screwgauge.scene.scene import Scene
    from screwgauge.solution import Solution

PICTURES = ("png", "svg", "pdf")
WIDTH, DPI = "17cm", 200  # a picture is as wide as the text of a page


def view(options: argparse.Namespace) -> int:
    """Show a mechanism, optionally with its differences from a second one."""
    from screwgauge.models.shapes import differences
    from screwgauge.reference.lint import suspicious
    from screwgauge.report.figures.saved import check_ending, picture_file
    from screwgauge.report.stage.drawing import drawing
    from screwgauge.scene.scene import Scene

    chosen = [name for name in ("out", *PICTURES, "port") if getattr(options, name) not in (None, False)]
    if len(chosen) > 1:
        raise DescriptionError(f"--{chosen[0]} and --{chosen[1]} cannot be combined", "view", "omit one of them")
    what = _load(options.what)
    mechanism = what.mechanism if isinstance(what, Scene) else what
    picture = next((getattr(options, name) for name in PICTURES if getattr(options, name)), None)
    file, inputs = options.out or picture, [*filter(None, (options.what, options.other))]
    if file:
        check_free(file, inputs, force=options.force)
    other = _load(options.other) if options.other else None
    other = other.mechanism if isinstance(other, Scene) else other
    unsigned = _unnamed_joints(options.what, mechanism) | (_unnamed_joints(options.other, other) if other else set())
    if picture:
        check_ending(picture, [f".{chosen[0]}"], f"view --{chosen[0]}")
        against = differences(mechanism, other, unsigned) if other else ()
        content = picture_file(drawing(mechanism, against), picture.suffix, WIDTH, DPI)
        say(str(save_file(picture, content, inputs, force=options.force)))
        for odd in suspicious(mechanism):
            complain(f"screwgauge: suspicious: {odd.sentence}")
        return 0
    text = _page(what, other, unsigned)
    if options.out:
        say(str(save_file(options.out, text, inputs, force=options.force)))
        return 0
    return _serve(text.encode(), options.port or 0)


def _load(name: str) -> Scene | Mechanism:
    """Load a scene, or the default scene of a description or model file; return the mechanism at rest if no scene can
    be made.
    """
    from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_path
    from screwgauge.models.importing import is_model
    from screwgauge.reference.files import A_PATH, is_path
    from screwgauge.scene.read import load_scene, scene_names

    import_named(name)
    if name in scene_names():
        return load_scene(name)
    if name not in mechanism_names() and not is_path(name) and not is_model(name):
        known = dict.fromkeys([*scene_names(), *mechanism_names()])
        raise UnknownNameError("scene, mechanism or model", name, known, besides=A_PATH)
    try:
        scene = load_scene(mechanism_path(name))
        for remark in scene.mechanism.remarks:
            complain(f"screwgauge: {remark}")
        return scene
    except ScrewgaugeError as error:
        try:
            still = load_mechanism(name, closed=False)
        except ScrewgaugeError:
            raise error from None
        complain(f"screwgauge: showing the home pose, because no motion is available: {error}")
        return still


def _unnamed_joints(name: str, mechanism: Mechanism) -> set[str]:
    """Return joints that a model file does not name: they represent closure points, and their axes have no sense of
    direction.
    """
    from screwgauge.models.importing import is_model

    if not is_model(name):
        return set()
    text = Path(name).read_text(encoding="utf-8", errors="replace")
    return {j.name for j in mechanism.joints if not any(f'"{each}"' in text for each in j.coordinates)}


def _page(what: Scene | Mechanism, other: Mechanism | None, unsigned: Collection[str] = ()) -> str:
    from screwgauge.report.blocks import Text
    from screwgauge.report.html import page
    from screwgauge.report.stage.picture import remarks, stage
    from screwgauge.scene.scene import Scene

    mechanism = what.mechanism if isinstance(what, Scene) else what
    moving = isinstance(what, Scene) and other is None  # two mechanisms are compared in the home pose
    if isinstance(what, Scene) and moving:
        picture = stage(*_solve(what))
    else:
        picture = stage(mechanism, other=other, unsigned=unsigned)
    about = [Text(what.description)] if isinstance(what, Scene) and what.description else []
    return page([Text(mechanism.title or mechanism.name, 1), *about, picture, *remarks(picture)])


def _solve(scene: Scene) -> tuple[Scene, Mapping[str, Solution]]:
    """Solve a few samples of a scene; if the solver fails, warn and return no solution."""
    from screwgauge.problem import spread
    from screwgauge.report.stage.motion import FRAMES
    from screwgauge.study.run import run

    scene = scene.at(scene.t[spread(len(scene.t), FRAMES)])
    try:
        results = run(scene, engines=("screw",))
    except ScrewgaugeError as error:
        complain(f"screwgauge: showing the scene without forces: {error}")
        return scene, {}
    for failure in results.failures.values():
        complain(f"screwgauge: showing the scene without forces: {failure.reason}")
    return scene, results.solutions


def _serve(text: bytes, port: int) -> int:
    """Serve one page on localhost until interrupted."""
    from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            ours = self.path == "/" and self.headers.get("Host", "").rpartition(":")[0] in ("127.0.0.1", "localhost")
            self.send_response(200 if ours else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(text) if ours else 0))
            self.end_headers()
            self.wfile.write(text if ours else b"")

        def log_message(self, *arguments: object) -> None:
            """Log nothing."""

    class Server(ThreadingHTTPServer):
        def service_actions(self) -> None:
            if is_stopped():  # interrupted while a thread was started, which suppresses the exception
                raise KeyboardInterrupt

        def handle_error(self, *request: object) -> None:
            """Report nothing: a browser may close the connection at any time."""

    try:
        server = Server(("127.0.0.1", port), Handler)
    except (OSError, OverflowError) as error:
        what = f"cannot serve on port {port} ({getattr(error, 'strerror', None) or error})".lower()
        raise OutputError(what, "view", "omit --port to use a free one") from None
    with server:
        say(f"http://127.0.0.1:{server.server_address[1]}/ (Ctrl-C stops it)")
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            say("")
    return 0
