"""Scenes: which mechanism, what acts on it, how it moves; read from TOML and checked before any engine runs."""
