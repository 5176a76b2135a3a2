"""Sweeps: many variants of a scene, the numbers with the largest effects, and selected variants checked by engines."""
