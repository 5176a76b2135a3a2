"""Stiff and extreme scenes: how many digits each engine keeps, and whether it says so where it does not."""
