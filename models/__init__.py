"""Descriptions of mechanisms (TOML), the URDF and MJCF models made from them, and their writers."""
