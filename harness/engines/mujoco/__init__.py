"""The engines mujoco and mujoco-full."""
