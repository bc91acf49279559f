"""The camera side in the form of Table 4 of Tian et al. 2022: wrong frames per 100, n_w.

`sequences` says what a drive is, `drives` renders held-out ones, `clips` finds real ones, `judge` runs the estimator,
its parts switched off in turn, and the voting baseline over them, `scores` counts with intervals, `report` writes the
page. `python -m benchmarks.vision.table4 --help` starts it.
"""
