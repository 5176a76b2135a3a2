"""Studies: tasks that engines solve, with a table of rows as result.

All of them share `runner` and `store`: tasks, executors, and rows on disk. `run` compares one scene;
`gate` checks many, `bench` measures error against run time, `stress` makes scenes extreme (`cases`),
and `matrix` varies versions. `screwgauge.report` shows the results.
"""
