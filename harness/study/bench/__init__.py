"""Benches (`run`, `forward_run`) and stress: methods answer questions of `cases.toml`, and tables list the results."""

import tomllib
from pathlib import Path
from typing import Any

TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("cases.toml").read_text(encoding="utf-8"))
