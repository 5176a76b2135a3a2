"""Benches: error against run time of contestants, on a given motion (`run`) or in a simulation (`forward_run`)."""
