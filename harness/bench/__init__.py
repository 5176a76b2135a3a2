"""Error against run time: contestants, timing protocol, slopes, and what leaving out buys."""
