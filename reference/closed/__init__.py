"""Closed poses of a mechanism: Newton's method, continuation of an assembly mode along a motion, initial guesses.

Other packages use `assembly_mode`. `loops` sets up the equations; `continuation` and `region` use `walk` to follow the
solutions from anchor to anchor (`anchors`); `newton` has the numerical tools.
"""
