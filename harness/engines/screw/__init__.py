"""The engine `screw`, which runs the solver of `screwgauge.reference`."""
