"""The variables of the units, in the order of their value references."""

from __future__ import annotations

from .settings import PARAMETERS
from .signals import INPUTS, INTERVAL_OUTPUTS, OUTPUTS

TRPAC_ESTIMATOR = INPUTS + OUTPUTS + PARAMETERS + INTERVAL_OUTPUTS
"""Variables of the unit `TrpacEstimator`."""
