"""Makes logs of cars whose deviation from the simulation is known to the generator alone.

Nothing of the product is imported here (a test proves it): what is shared is the contract of files and effect ids.
"""
