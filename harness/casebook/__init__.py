"""Named discrepancies of the engines, each with its cause, its remedy and the versions that showed it."""
