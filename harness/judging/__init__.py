"""Judges one engine by the laws of mechanics alone; shares no motion formula with the screw solver."""
