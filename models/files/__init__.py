"""Reads and edits the text of model files; each format has its own module."""
