"""Studies: problems put to methods, giving tables. run, bench, stress."""
