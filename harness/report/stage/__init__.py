"""The mechanism in space: drawn from its description, in motion, with what acts on it and what holds it."""
