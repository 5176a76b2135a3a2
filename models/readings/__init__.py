"""Readings of model files by each library, in one engine-neutral form."""
