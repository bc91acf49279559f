"""Where the gap lies: places, free terms in the equations of the car, and what no effect explains, in words."""
