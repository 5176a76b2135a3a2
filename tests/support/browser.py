"""Pages in the Chromium that is installed; tests are skipped where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from screwgauge.report.write import browser
from support.errors import OutputError

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SHOWN = 60e3  # longest wait for anything on a page, drawn without a graphics card on a busy machine [ms]


@dataclass
class Opened:
    page: Any
    path: Path
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def ask(self, script: str) -> Any:
        return self.page.evaluate(script)

    def at(self, width: int, height: int = 800, **media: str) -> None:
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.emulate_media(**{"media": "screen", "color_scheme": "light", **media})

    @contextmanager
    def beside(self, path: Path, width: int, height: int) -> Iterator[Opened]:
        page = self.page.context.browser.new_page(viewport={"width": width, "height": height})
        yield _shown(page, path)
        page.close()

    def check_quiet(self) -> None:
        assert self.said == []
        assert self.asked == [self.path.as_uri()]


@contextmanager
def open_page(path: Path, width: int, height: int) -> Iterator[Opened]:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    try:
        program = browser()
    except OutputError as error:
        pytest.skip(str(error))
    with playwright.sync_playwright() as driver:
        window = driver.chromium.launch(executable_path=program, args=FLAGS)
        shown = _shown(window.new_page(viewport={"width": width, "height": height}), path)
        shown.page.wait_for_selector(".stage canvas")
        yield shown
        window.close()


def _shown(page: Any, path: Path) -> Opened:
    shown = Opened(page, path)
    page.set_default_timeout(SHOWN)
    page.on("console", lambda message: shown.said.append(message.text))
    page.on("pageerror", lambda error: shown.said.append(str(error)))
    page.on("request", lambda request: shown.asked.append(request.url))
    page.goto(path.as_uri())
    return shown
