"""The screw-based solver, which needs numpy but no engine.

Twists and screws are ``[angular; linear]`` about the world origin O; all units are SI. Equation numbers refer to
Zhao, Wei and Sun, "Dynamics of a 3-UPS-UPU-S Parallel Mechanism", Appl. Sci. 2023, 13, 3912.
"""
