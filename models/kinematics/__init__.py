"""How a reading moves: its tree at samples of motion, its loop equations, and its home elsewhere."""
