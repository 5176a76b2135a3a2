"""Studies: tasks put to engines, with a table of rows as result.

`runner` and `store` are what all of them share: tasks, where they run, and rows on disk. `run` compares one scene;
`gate` checks many, `bench` measures error against run time, `stress` makes scenes extreme (`cases`),
and `matrix` varies versions. How results are shown is in `screwgauge.report`.
"""
