"""The mechanism in 3D, drawn from its description, in motion, with forces and constraints."""
