"""Sweeps: many variants of a scene, the numbers with the largest effects, and some variants checked by engines."""
