"""Reads and edits the text of model files, with one module per format."""
