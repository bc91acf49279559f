"""How far off are the estimators, and is the deviation that they tell of themselves honest?"""
