"""The engines pinocchio and pinocchio-full."""
