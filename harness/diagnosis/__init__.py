"""Why two models of a machine differ: what each says in physical terms, and which change ends the difference."""
