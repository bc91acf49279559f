"""The camera side: surface class of the road ahead from pictures."""
