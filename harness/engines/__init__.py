"""The engines: one folder or file each, the only place that imports its library."""
