"""Reports of results: files for people and programs, formatted without any computation."""
