"""How often is the diagnosis of the sim-to-real gap right?"""
