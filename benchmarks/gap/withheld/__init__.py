"""The check of the diagnosis on withheld data.

`generator` makes the logs and knows nothing of the product: its own plant, integrator, noise and forms of the effects.
`runner` shows them to the diagnosis, `scorer` opens the seal. `python -m benchmarks.gap.withheld --help` starts it.
"""
