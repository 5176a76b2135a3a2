"""Why two models of one machine differ.

`machine` and `pairing` find which joint and body of A is which of B. `differences` are facts of one property of a part
(`properties` has the table), each of a kind: of the models, of printed digits, or of convention alone. `causes` group
differences that one edit would make, weigh them against the torques, and prove that they are all by changing the file
(`files`). `diagnose` is the whole way.
"""
