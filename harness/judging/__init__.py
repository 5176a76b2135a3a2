"""The judge: checks one engine against the laws of mechanics, without using motion formulas of the screw solver."""
