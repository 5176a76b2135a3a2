"""The witness: a second statement of mechanics, by moving points and bodies, to judge engines and explain diagnoses.

Classical vector mechanics, and not the screw formulas of the solver. What a mechanism is and how rotations are written
is shared with the solver, nothing else.
"""
