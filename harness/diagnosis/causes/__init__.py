"""Causes: differences that one edit would make, each group with its share of the torque difference, and their proof."""
