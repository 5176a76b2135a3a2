"""The gate: checks of scenes and pairs of models against tolerances and a baseline, for continuous integration."""
