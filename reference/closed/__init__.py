"""Closed poses: found, followed on their branch, predicted."""
