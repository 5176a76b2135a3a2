"""Diagnosis: why two models of one machine differ.

`machine` pairs joints and bodies of A with those of B. `facts` are differences of one property of a part, listed in
`properties`; each is attributed to the models, to printed digits, or to a convention. `explanation` chooses the
alignment with the fewest causes. `causes` group facts that a single edit would explain, weigh them by their torques and
name likely slips. `fix` proves with a corrected file that the facts are complete. `words` and `sentences` express the
results in English.
"""
