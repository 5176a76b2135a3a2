"""Named discrepancies of the engines, each with its cause, its remedy and the affected versions."""
