"""The paper's errata, measured."""
