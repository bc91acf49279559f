"""How often is the camera side wrong, and on what does that hang?"""
