"""Inverse dynamics as a straight-line program: the scalar equations of one mechanism, traced once and run on samples.

`equations` is the only source of the equations, `trace` records them, `program` keeps what is wanted; `lanes` runs a
program with NumPy and `native` as machine code.
"""
