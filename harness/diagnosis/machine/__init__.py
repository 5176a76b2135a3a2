"""Machines as rigid bodies and links, independent of a file's loop cuts, order, names and frames."""
