"""Diagnosis: why two models of one machine differ.

`machine` pairs joints and bodies of A with joints and bodies of B. `facts` are differences in one property of a part;
`properties` lists these properties. Each fact is attributed to the models, to printed digits, or to a convention.
`explanation` chooses the alignment with the fewest causes. `causes` groups facts that a single edit would explain,
ranks the groups by their share of the torque difference and names likely slips. `fix` proves with a corrected file that
the facts are complete. `words` and `sentences` express the results in English.
"""
