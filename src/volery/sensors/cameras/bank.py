"""The bank of all cameras of one model and phase."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import read_only
from volery.core.errors import DataFileError
from volery.sensors.bank import NoisyBank, SensorGroup
from volery.sensors.cameras.camera import EVERY_PART, Images, Part, take
from volery.sensors.cameras.light import Light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.cameras.precipitation import falling_in
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.samples import CameraFrames
from volery.vehicle.pose_history import KEPT_NS
from volery.world.scene import Scene
from volery.world.weather import Weather

_LONGEST_READOUT_NS = KEPT_NS - 10_000_000


class CameraBank(NoisyBank):
    """Renders the images of all cameras of one model and phase together.

    An image is available when its last row has been read out. Only the parts that
    `requested_parts()` returns are rendered; the choice does not affect later images. `light_in`
    returns the light in a weather.

    Raises `DataFileError` if the model's readout takes longer than the pose history reaches.
    """

    name = "camera"

    def __init__(
        self,
        model: CameraModel,
        group: SensorGroup,
        scene: Scene,
        light_in: Callable[[Weather], Light],
    ) -> None:
        if model.readout_ns > _LONGEST_READOUT_NS:
            raise DataFileError(
                f"camera '{model.name}': readout_s = {model.readout_s} is too long; "
                f"{_LONGEST_READOUT_NS / 1e9} at most"
            )
        super().__init__(group)
        self.lag_ns = model.readout_ns
        self.requested_parts: Callable[[], Collection[Part]] = lambda: EVERY_PART
        """Returns the parts of the images that have receivers now."""
        self.model = model if group.keys is not None else model.without_noise()
        """Model of the cameras."""
        self._scene = scene
        self._light_in = light_in
        self._mounts = stack_mounts(group.mounts)

    @property
    def pixels(self) -> int:
        """Pixels of an image."""
        return self.model.width * self.model.height

    def is_wanted(self) -> bool:
        """Returns whether any part of the images has a receiver."""
        return bool(self.requested_parts())

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> CameraFrames:
        """Returns image number `k` of all cameras; `time_ns` is the exposure of the first row.

        Parts without a receiver have no pixels, (S, 0, 0), unless none has one: then all are
        rendered.
        """
        return self.sample_rows(np.arange(len(self._rows)), k, time_ns, fleet)

    def sample_rows(
        self, rows: NDArray[np.int64], k: int, time_ns: int, fleet: Fleet
    ) -> CameraFrames:
        """Returns what `sample` returns for the cameras `rows` (R,); those of others are black."""
        batch = make_batch(
            self._rows[rows],
            rows,
            time_ns,
            self._noise.keys[rows],
            k - self._noise.first_k[rows],
            self._mounts,
        )
        parts = self.requested_parts() or EVERY_PART
        light = self._light_in(fleet.weather)
        images = take(
            self._scene,
            self.model,
            light,
            batch,
            fleet.history,
            rotors=fleet.rotor_turns(),
            parts=parts,
            falling=falling_in(fleet.weather, light),
        )
        arrays = _arrays(images, rows, len(self._rows))
        return CameraFrames(self.sensors, time_ns, self.model, **arrays)


def _arrays(images: Images, rows: NDArray[np.int64], count: int) -> dict[str, Any]:
    """Returns arrays of `count` images, of which `images` are `rows` and the others zero.

    A part that was not rendered has no pixels.
    """
    arrays: dict[str, Any] = {}
    for name, part in images._asdict().items():
        whole = part
        if part is None:
            whole = np.zeros((count, 0, 0), _KINDS[name])
        elif len(rows) < count:
            whole = np.zeros((count, *part.shape[1:]), part.dtype)
            whole[rows] = part
        arrays[name] = read_only(whole)
    return arrays


_KINDS: dict[str, type] = {
    "colour": np.uint8,
    "depth": np.float32,
    "instance": np.int32,
    "material": np.uint8,
}
