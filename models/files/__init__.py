"""Texts of model files, one module a format: what they say, and the same text with changes."""
