"""The witness: a second formulation of mechanics, in terms of moving points and bodies, to judge and diagnose engines.

It uses classical vector mechanics, not the screw formulas of the solver. It shares only the definition of a mechanism
and the representation of rotations with the solver.
"""
