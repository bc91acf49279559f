"""What is known of the road's friction while the tyre is not known: a grid of frictions times a few tyres.

`tyres` has the curves, `roads` the cells and the camera's priors, `blocks` the means that readings are counted in,
`belief` the filter, `interval` what it says.
"""
