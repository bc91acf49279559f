"""Probability distribution over road friction and tyre: a grid of frictions times a few tyres.

`tyres` has the curves, `roads` the cells and the camera's priors, `blocks` the means that readings are counted in,
`belief` the filter, `interval` its mean, deviation and bounds.
"""
