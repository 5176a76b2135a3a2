"""How the tree of a reading moves, for all samples at once, and rigid matter."""
