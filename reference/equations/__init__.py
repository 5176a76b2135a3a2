"""Equations of motion, written once and generic over the scalar type.

Arrays have any leading shape, ``(..., 3)``, ``(..., 6)``; their elements are floats of any precision, nodes of a trace,
from which a program is made, or balls. `ops` has what depends on the scalar type.
"""
