"""Scenes: a mechanism, its motion and the forces acting on it, read from TOML and checked before any engine runs."""
