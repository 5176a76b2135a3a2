"""Reports: results as files for people and for programs. This package formats results and computes nothing."""
