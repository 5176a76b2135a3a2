"""The witness: mechanics stated a second time, by moving points and bodies, to judge engines and to explain diagnoses.

Classical vector mechanics, and not the screw formulas of the solver. What a mechanism is and how rotations are written
is shared with the solver, nothing else.
"""
