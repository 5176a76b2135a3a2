"""Reports what a run found: files for people and programs. Formats only; nothing is computed here."""
