"""3D scenes of a mechanism in motion, drawn from its description, with forces and constraints."""
