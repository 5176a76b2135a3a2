"""Dynamics as straight-line programs: the scalar equations of one mechanism, traced once and run on samples.

`equations` is the only source of the equations; `trace` records them; `tracing` chooses outputs of inverse and forward
dynamics; `program` runs the instructions with NumPy, and `native` runs them as machine code.
"""
