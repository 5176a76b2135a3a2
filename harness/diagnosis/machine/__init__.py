"""Machines as rigid bodies and links, independent of the cuts, order, names and frames of files."""
