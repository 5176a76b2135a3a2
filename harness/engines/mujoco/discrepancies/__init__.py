"""Discrepancies that users of MuJoCo meet, each as a function that shows it on a small model."""
