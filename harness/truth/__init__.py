"""The mechanism's motion and forces in ball arithmetic: every number comes with a rigorous radius.

Independent of `screwgauge.reference`: only the tables of a description, their names and an unverified starting guess
of the positions come from there. Needs python-flint (the extra ``truth``).
"""
