"""Sweeps: many variants of one scene, which numbers cost most, and a sample of them checked by the other engines."""
