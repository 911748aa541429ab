"""Saves samples as plain data, without what their bank knows: sensors and model."""

from __future__ import annotations

from typing import Any

from volery.engine.engine import SensorBank
from volery.runtime.construction.sensor_suites import RESULT_OF
from volery.sensors.samples import JointAngles, Samples


def saved_samples(samples: Samples | None) -> dict[str, Any] | None:
    """Returns the fields of samples that change, for `restored_samples`; arrays are not copied."""
    if samples is None:
        return None
    return {name: v for name, v in vars(samples).items() if name not in ("sensors", "model")}


def restored_samples(bank: SensorBank, fields: dict[str, Any] | None) -> Samples | None:
    """Returns the samples of `bank` that `saved_samples` saved."""
    if fields is None:
        return None
    model = getattr(getattr(bank, "bank", bank), "model", None)
    own = {"sensors": bank.sensors} | ({} if model is None else {"model": model})
    kind: type[Any] = JointAngles if bank.name == "joints" else RESULT_OF[bank.name]
    made: Samples = kind(**own, **fields)
    return made
