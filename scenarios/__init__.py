"""The reference plant, its roads, vehicles and manoeuvres, and the pictures that its camera would take."""
