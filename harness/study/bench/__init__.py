"""Benches (`run`, `forward_run`) and stress: methods put to questions of `cases.toml`, measured and put into tables."""
