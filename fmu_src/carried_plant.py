"""`scenarios.plant` within a unit: without its sensors and their imports."""
