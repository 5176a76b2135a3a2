"""The engines. Each engine has its own directory or file; no other module imports the engine's library."""
