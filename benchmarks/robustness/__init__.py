"""What do the units and the readers of files do with rubbish, in the long run, and under other clients?"""
