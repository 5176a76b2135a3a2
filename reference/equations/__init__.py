"""Equations of motion, implemented once for all scalar types.

Arrays may have any leading shape, ``(..., 3)``, ``(..., 6)``; their elements are floats of any precision, nodes of a
trace (from which a program is compiled) or balls. `ops` has the operations that depend on the scalar type.
"""
