"""Reads the text of model files and edits it, one module for each format."""
