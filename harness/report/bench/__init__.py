"""What is told of a bench."""
