"""Scenes: a mechanism, what acts on it and how it moves; read from TOML and checked before any engine runs."""
