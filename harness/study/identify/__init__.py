"""Identification: which numbers of a machine its forces tell, and the numbers that measured forces tell."""
