"""What a diagnosis finds: models changed at random, and models that only look different."""
