"""Stress cases as data: ladders, and for each severity the problems and the methods that are put to them."""
