"""Why two models of one machine differ.

`machine` finds which joint and body of A is which of B. `facts` are differences of one property of a part, `properties`
has the table, each of a kind: of the models, of printed digits, or of convention alone. `explanation` chooses the way
that tells them with the fewest causes. `causes` group facts that one edit would make, weigh them against the torques,
and say what somebody may have done. `fix` proves by a changed file that they are all. `words` make English, once.
"""
