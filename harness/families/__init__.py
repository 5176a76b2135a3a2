"""Generates families of random mechanisms with motions, for the tests, the campaigns and users.

A family places its joints in the world (`placements`); `sketch` turns that into a description with random frames,
bodies and names; `draw` adds a motion that stays regular and writes both as TOML files.
"""
