"""Facts: differences between two machines as data, with the changes that give A the value of B."""
