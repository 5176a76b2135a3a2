"""Named discrepancies of the engines, each with the reproduction that shows it, its cause and its remedy."""
