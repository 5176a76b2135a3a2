"""Cases that drive engines forward, or for long."""
