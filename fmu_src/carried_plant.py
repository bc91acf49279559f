"""The reference plant as the unit carries it: without its sensors and what they need."""
