"""Reports of results: files for people and programs. This package formats results and computes nothing."""
