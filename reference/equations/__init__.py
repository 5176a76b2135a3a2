"""The equations of motion, each once, over any kind of number.

Arrays have any leading shape, ``(..., 3)``, ``(..., 6)``; their elements are floats of any precision, nodes of a trace,
from which a program is made, or balls. What depends on the kind of number is in `ops`.
"""
