"""The screw-based solver: numpy only, no engine.

Twists and screws are ``[angular; linear]`` about the world origin O; everything is SI. Equation numbers are
those of Zhao, Wei and Sun, "Dynamics of a 3-UPS-UPU-S Parallel Mechanism", Appl. Sci. 2023, 13, 3912.
"""
