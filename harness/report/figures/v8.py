"""The drawing process: calls a function of vl_convert, which embeds a browser's JavaScript engine, for each input line.

Run as a program: ``python -m screwgauge.report.figures.v8 FD``, where FD is the file descriptor of its lifeline.
"""

from __future__ import annotations

import base64
import json
import logging
import os
import signal
import sys
from multiprocessing.connection import Connection
from typing import Any

from screwgauge.study.lifeline import hold


def main() -> None:
    """Answer lines ``{"call", "arguments", "named"}`` with ``{"text"}``, ``{"bytes"}`` or ``{"error"}``."""
    hold(Connection(int(sys.argv[1]), writable=False))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles the interrupt, and then ends this process
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # keep output of libraries out of the answers
    import vl_convert

    for name in ("vl_convert", "swc_ecma_transforms_optimization"):  # one warns of missing numbers, which notes report;
        logging.getLogger(name).setLevel(logging.CRITICAL)  # the other logs calls of its passes as errors
    for line in sys.stdin.buffer:
        print(json.dumps(_answer(vl_convert, json.loads(line))), file=answers, flush=True)


def _answer(library: Any, question: dict[str, Any]) -> dict[str, Any]:
    try:
        result = getattr(library, question["call"])(*question["arguments"], **question["named"])
    except Exception as error:  # any exception: its message replaces the picture
        return {"error": f"{type(error).__name__}: {error}"[:1000]}
    return {"bytes": base64.b64encode(result).decode()} if isinstance(result, bytes) else {"text": result}


if __name__ == "__main__":
    main()
