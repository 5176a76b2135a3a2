"""The engine `screw`: the solver of screwgauge.reference."""
