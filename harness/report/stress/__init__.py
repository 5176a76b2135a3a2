"""What is told of the stress cases."""
