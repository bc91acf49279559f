"""A camera computer: class and confidence of each picture, as a unit without networks takes them by number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.library import networks_folder
from trpac_core.errors import TrpacError
from trpac_core.estimator import EstimatorConfig, RoadClass
from trpac_core.parameters.configuration import configuration
from trpac_core.parameters.settings import ESTIMATOR_PARAMETERS
from trpac_core.parameters.variables import Kind
from trpac_core.sensors import filter_share
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import Segmenter, SurfaceClassifier
from trpac_core.vision.sides import SidesIfe, SidesState
from trpac_core.vision.trajectory import Motion

_TYPES = {Kind.INTEGER: int, Kind.BOOLEAN: bool, Kind.REAL: float}


def unit_settings(given: Mapping[str, float]) -> EstimatorConfig:
    """Settings of a unit of one wheel by its parameters, its defaults for the others; TrpacError for wrong ones."""
    values = {v.name: _TYPES[v.kind](given.get(v.name, v.start)) for v in ESTIMATOR_PARAMETERS}
    try:
        return configuration(ESTIMATOR_PARAMETERS, values, EstimatorConfig())
    except ValueError as error:
        raise TrpacError(str(error)) from error


class CameraComputer:
    """The image estimator of one side or of both, with its memory.

    Parameters
    ----------
    settings : IfeConfig
        Settings, such as `unit_settings(...).image_settings`.
    sides : tuple of str
        Tracks to classify: 'left', 'right', or both in this order.
    threads : int
        Threads of each network.

    Raises
    ------
    ModelError
        A network that cannot be loaded.
    """

    def __init__(self, settings: IfeConfig, sides: tuple[str, ...], threads: int = 2) -> None:
        folder, self._threshold = networks_folder(), settings.flag_threshold
        networks = (
            Segmenter(folder / "segmenter.onnx", threads),
            SurfaceClassifier(folder / "surface.onnx", threads),
        )
        both = len(sides) == 2
        side: Any = settings.side if both else sides[0]
        self._ife: Any = (
            SidesIfe(settings, *networks) if both else Ife(replace(settings, side=side), *networks)
        )
        self.forget()

    def forget(self) -> None:
        """Forget all pictures."""
        self._state: Any = SidesState() if isinstance(self._ife, SidesIfe) else IfeState()

    def classes(self, image: NDArray[np.uint8], motion: Motion) -> list[RoadClass]:
        """Class and confidence of a picture for each side.

        Raises
        ------
        ImageError, ModelError
            A picture or a network that cannot be used; the memory is then unchanged.
        """
        self._state, *results = self._ife.process(self._state, image, motion)
        return [RoadClass(seen.surface, seen.told_by_bus(self._threshold)) for seen in results]


class CarMotion:
    """The car's motion step by step, from readings that are filtered as within the unit; an acceleration of 0 counts.

    Parameters
    ----------
    step_s, filter_s : float
        Step, and time constant of the filter on the sensors [s].
    """

    def __init__(self, step_s: float, filter_s: float) -> None:
        self._step_s, self._share = step_s, filter_share(step_s, filter_s)
        self._acceleration_m_s2: float | None = None
        self._way_m = 0.0

    def next(self, speed_m_s: float, acceleration_m_s2: float) -> Motion:
        """The motion at the start of the next step, from its readings [m/s], [m/s^2]."""
        before = acceleration_m_s2 if self._acceleration_m_s2 is None else self._acceleration_m_s2
        self._acceleration_m_s2 = before + self._share * (acceleration_m_s2 - before)
        motion = Motion(speed_m_s, self._acceleration_m_s2, way_m=self._way_m)
        self._way_m += speed_m_s * self._step_s
        return motion
