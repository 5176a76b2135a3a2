"""The bench of a forward scene: error, energy and time of many methods."""
