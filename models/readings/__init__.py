"""Readings of model files by different libraries, in one engine-neutral form."""
