"""What is told of the paper's errata."""
