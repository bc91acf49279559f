"""Training of the networks in `models/`: one command, `python -m models.training --data DIR`.

Needs the training extra (`pip install 'trpac-fmu[all,train]'`); the estimator itself never imports this package.
"""
