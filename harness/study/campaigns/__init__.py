"""Many mechanisms, model files or versions: a row for each, and rows that are there are kept."""
