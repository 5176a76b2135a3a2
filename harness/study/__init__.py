"""Studies: tasks that engines solve, each resulting in a table of rows.

All studies share `runner` and `store`: tasks, executors, and rows on disk. `run` compares engines on one scene; `gate`
checks many scenes, `bench` measures error against run time, `stress` makes scenes extreme (`cases`), and `matrix`
varies versions. `screwgauge.report` shows the results.
"""
