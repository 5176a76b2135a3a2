"""Diagnosis: why two models of one machine differ.

`machine` pairs joints and bodies of A with those of B. `facts` are differences of one property of a part, listed in
`properties`; each belongs to the models, to printed digits, or to a convention. `explanation` chooses the alignment
with the fewest causes. `causes` group facts that one edit would make, weigh them by their torques and name likely
slips. `fix` proves by a corrected file that the facts are complete. `words` and `sentences` put all of it into English.
"""
