"""How long does a step of the estimators, the plant and the units take, and does the rig keep its deadlines?"""
