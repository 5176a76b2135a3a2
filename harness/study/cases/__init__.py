"""What stress cases ask of engines on each rung; the cases themselves are data, ``cases.toml``, and run by `stress`."""
