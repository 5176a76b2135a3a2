"""Identification: which numbers of a machine can be determined from its forces, and their estimates."""
