"""Road surface in single pictures of any camera, and in the frames of one drive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenarios.camera.files import load_camera
from scenarios.library import networks_folder
from scenarios.stills import StillNetworks
from trpac_core.errors import TrpacError
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import check_size, decode_image, eight_bits
from trpac_core.vision.trajectory import Motion

Order = Literal["bgr", "rgb"]


@dataclass(frozen=True)
class PictureClass:
    """The surface of the road in a picture.

    Attributes
    ----------
    surface : str
        dry, wet or snow_ice.
    confidence : float
        Its probability; of a frame the confidence Q_v [-].
    probabilities : dict
        Each surface's probability [-].
    flag : bool
        Whether the class is used; of a single picture whether its probability is above 0.5.
    """

    surface: str
    confidence: float
    probabilities: dict[str, float]
    flag: bool


def picture_of(
    image: str | Path | NDArray[np.generic], order: Order, bits: int | None, upright: bool
) -> NDArray[np.uint8]:
    """A picture as BGR of 8 bits, shape (height, width, 3); raises TrpacError."""
    if isinstance(image, (str, Path)):
        return decode_image(image, upright=upright, bits=bits)
    if not isinstance(image, np.ndarray):
        raise TrpacError(
            f"image is a {type(image).__name__}; expected a path or a numpy array. A picture of PIL is "
            "np.asarray(image.convert('RGB')) with order='rgb'."
        )
    if image.ndim != 3 or image.shape[2] != 3:
        raise TrpacError(
            f"image is an array of shape {image.shape}; expected (height, width, 3): repeat a grey one, leave out "
            "alpha, and move the channels to the end."
        )
    if order not in ("bgr", "rgb"):
        raise TrpacError(f"order is {order!r}; expected 'bgr' or 'rgb'.")
    check_size(image.shape[1], image.shape[0], "image")
    array = eight_bits(image, bits=bits)
    return np.ascontiguousarray(array[..., ::-1] if order == "rgb" else array)


@lru_cache(maxsize=2)
def _networks(folder: Path) -> StillNetworks:
    return StillNetworks.load(folder)


def classify(
    image: str | Path | NDArray[np.generic],
    *,
    order: Order = "bgr",
    bits: int | None = None,
    networks: str | Path | None = None,
) -> PictureClass:
    """The surface of the road in a single picture, of any camera.

    Parameters
    ----------
    image : path, or array of uint8, uint16 or floats from 0 to 1, shape (height, width, 3)
        JPEG or PNG, or its pixels.
    order : {'bgr', 'rgb'}
        Channel order of an array.
    bits : int, optional
        How many bits a picture of 16 uses; by default 12 where all values are below 4096.
    networks : path, optional
        Folder with segmenter.onnx and surface.onnx; by default those of the package. Files are read once.

    Raises
    ------
    TrpacError
        A picture that cannot be read, or without usable road; a network that cannot be used.
    """
    name = str(image) if isinstance(image, (str, Path)) else "image"
    folder = networks_folder() if networks is None else Path(networks).resolve()
    shares = _networks(folder).probabilities(picture_of(image, order, bits, upright=True), name)
    best = int(shares.argmax())
    probabilities = {surface.label: float(shares[surface]) for surface in Surface}
    return PictureClass(Surface(best).label, float(shares[best]), probabilities, bool(shares[best] > 0.5))


class VisionEstimator:
    """The image estimator over the frames of one drive, with its state.

    Parameters
    ----------
    camera : path, name or Camera
        Lens and mounting, as in camera.yaml.
    networks : path, optional
        As of `classify`.

    Raises
    ------
    TrpacError
        A camera file that is wrong; a network that cannot be used.
    """

    def __init__(self, camera: str | Path | Camera, *, networks: str | Path | None = None) -> None:
        lens = camera if isinstance(camera, Camera) else load_camera(camera)
        self._ife = Ife.load(
            IfeConfig(camera=lens), networks_folder() if networks is None else Path(networks)
        )
        self._state, self._time_s, self._way_m = IfeState(), 0.0, 0.0

    def step(
        self,
        image: str | Path | NDArray[np.generic],
        t: float,
        *,
        speed: float,
        steering: float = 0.0,
        order: Order = "bgr",
        bits: int | None = None,
    ) -> PictureClass:
        """The surface of the road ahead of the wheels in the next frame.

        Parameters
        ----------
        image : path, or array, shape (height, width, 3)
            The frame, as of `classify`.
        t : float
            Time at which it was taken [s].
        speed, steering : float
            Speed of the car [m/s], and steering angle of the front wheels, positive to the left [rad].
        order, bits
            As of `classify`.

        Raises
        ------
        TrpacError
            A frame that cannot be used; the state is then unchanged.
        """
        way_m = self._way_m + max(0.0, t - self._time_s) * speed * (self._state.frame_count > 0)
        motion = Motion(speed, steering_angle_rad=steering, way_m=way_m)
        state, seen = self._ife.process(self._state, picture_of(image, order, bits, upright=False), motion)
        self._state, self._time_s, self._way_m = state, t, way_m
        probabilities = {s.label: float(p) for s, p in zip(Surface, seen.near.probabilities, strict=True)}
        return PictureClass(seen.surface.label, float(seen.Q_v), probabilities, bool(seen.flag))
