"""Time integration of any mechanism, and the established problems."""
