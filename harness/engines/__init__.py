"""The engines, one directory or file each, which alone imports the engine's library."""
