"""The variables of the units, in the order of their value references."""

from __future__ import annotations

from .settings import PARAMETERS
from .signals import INPUTS, OUTPUTS

TRPAC_ESTIMATOR = INPUTS + OUTPUTS + PARAMETERS
"""Variables of the unit `TrpacEstimator`."""
