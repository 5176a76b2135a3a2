"""Closed poses of a mechanism: Newton's method, continuation of an assembly mode along a motion, initial guesses.

`assembly_mode` is what other packages use; `loops` sets up the equations, `continuation` and `region` follow them by
`walk` from anchor to anchor (`anchors`), and `newton` has the numerical tools.
"""
