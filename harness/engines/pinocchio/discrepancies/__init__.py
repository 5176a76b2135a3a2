"""Discrepancies that users of Pinocchio meet, each as a function that shows it on a small model."""
