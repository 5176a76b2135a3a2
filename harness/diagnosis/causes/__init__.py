"""Causes of differences, their shares of the torque difference, and the slips that likely led to them."""
