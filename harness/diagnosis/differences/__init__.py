"""What two readings say otherwise, in physical terms."""
