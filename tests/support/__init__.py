"""What tests need of the package, by purpose: where it is defined inside is known here and nowhere else in tests."""
