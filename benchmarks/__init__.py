"""Measurements of the project, by the question that they answer; each module says how it is run.

accuracy
    How far off are the estimators, and is the deviation that they tell of themselves honest?
speed
    How long does a step take, and does the rig keep its deadlines? `make bench`.
gap
    How often is the diagnosis of the sim-to-real gap right, on cars that it has never seen? `make blind`.
vision
    How often is the camera side wrong?
robustness
    What do the units and the readers of files do with rubbish, in the long run, and under other clients? Which faults
    in the code would no test find?

Figures go to standard output or to `--out`, by default below out/; those that are kept stand in docs/.
"""
