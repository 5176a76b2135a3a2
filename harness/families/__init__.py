"""Families of random mechanisms in motion, for testing engines in tests, in campaigns and by users.

A family places its joints in the world (`placements`); `sketch` turns that into a description with random frames,
bodies and names; `draw` adds a motion that stays regular and writes both as TOML files.
"""
