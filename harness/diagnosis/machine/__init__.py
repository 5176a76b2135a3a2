"""Machines as rigid bodies and the links between them, whatever files say of cuts, order, names and frames."""
