"""Identification: the numbers of a machine that its forces determine, and their estimates from measured forces."""
