"""Cases of inverse dynamics: given motions, every engine against the truth."""
