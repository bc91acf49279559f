"""Parameters of the estimator's unit: those of the estimator and one of the unit."""

from __future__ import annotations

from trpac_core.parameters.settings import ESTIMATOR_PARAMETERS
from trpac_core.parameters.variables import Kind, Variable

BUFFERS_ENABLED = "image.buffers_enabled"
"""Parameter of the unit itself, not of the estimator."""

PARAMETERS = (
    *ESTIMATOR_PARAMETERS,
    Variable(
        BUFFERS_ENABLED,
        Kind.BOOLEAN,
        "parameter",
        "fixed",
        "Pictures in memory are read; false: the inputs image.* are ignored",
        start=True,
    ),
)
