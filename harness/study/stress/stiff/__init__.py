"""The case of stiff springs across the legs."""
