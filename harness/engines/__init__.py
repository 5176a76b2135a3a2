"""Everything that answers a problem: one folder or file for each engine, the only place that imports its library."""
