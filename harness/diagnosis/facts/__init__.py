"""Facts: what two machines differ in, without a word of text; a row knows what to change in A to have B's value."""
