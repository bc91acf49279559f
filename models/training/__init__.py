"""Training of the networks in `models/`: one command, `python -m models.training --data DIR`.

Needs the training extra (`pip install -r requirements/train.txt`); the estimator itself never imports this package.
"""
