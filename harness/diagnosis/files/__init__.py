"""Model files as text: what they say link by link, and changes in nothing else."""
