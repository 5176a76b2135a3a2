"""The engines. Each has its own directory or file, the only place that imports the engine's library."""
