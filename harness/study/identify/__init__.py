"""Identification: which numbers of a machine its forces determine, and their estimates from measured forces."""
