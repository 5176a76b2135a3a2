"""Which part of one model is which of another, and both in the same terms."""
