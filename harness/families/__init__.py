"""Generates families of random mechanisms with motions, for tests, campaigns and users.

A family places its joints in the world frame (`placements`); `sketch` turns them into a description with random frames,
bodies and names; `draw` adds a motion without singular poses and writes both as TOML files.
"""
