"""Radio of a scenario: topics that UAVs exchange, and the channel model."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, NonNegative, Positive, Topic

_Decibels = Annotated[float, Field(ge=0.0, le=200.0)]
_Interval = Annotated[float, Field(ge=1e-3)]


class RelayedTopic(Data):
    """A topic of each UAV that its radio sends to all others, which receive it as `radio/NAME`."""

    name: Topic
    """Name below the UAV's name."""
    type: Annotated[str, Field(pattern=r"^\w+/msg/\w+$")]
    """Message type such as `std_msgs/msg/String`; messages must identify their sender."""


class Radio(Data):
    """A packet radio on every UAV of a type with `radio`; all use one channel.

    The defaults are those of a small 2.4 GHz module at the lowest rate of IEEE 802.11a/g: 6 Mbit/s
    of BPSK in 20 MHz at 100 mW; values without a source are modelling choices.
    """

    links: Literal["modelled", "ideal"] = "modelled"
    """Ideal links lose nothing and have no latency."""
    topics: tuple[RelayedTopic, ...] = ()
    """Topics that the radios carry."""
    frequency_mhz: Annotated[float, Field(ge=100.0, le=6000.0)] = 2437.0
    """Channel 6 of IEEE 802.11."""
    power_dbm: Annotated[float, Field(ge=-30.0, le=50.0)] = 20.0
    """Power of the transmitter."""
    antenna_gain_dbi: Annotated[float, Field(ge=-20.0, le=30.0)] = 2.0
    """Gain of each antenna, the same in all directions."""
    bandwidth_mhz: Positive = 20.0
    """Bandwidth of the channel."""
    noise_figure_db: _Decibels = 6.0
    """Noise figure of the receiver."""
    bit_rate_mbit_s: Positive = 6.0
    """Rate of the bits on the air."""
    exponent: Annotated[float, Field(ge=1.0, le=6.0)] = 2.0
    """Exponent of the path loss over distance; 2: free space."""
    shadowing_db: _Decibels = 3.0
    """Standard deviation of the slow fading of a pair."""
    shadowing_s: _Interval = 1.0
    """Time for which the slow fading of a pair is constant."""
    vegetation: Literal["p833", "weissberger", "none"] = "p833"
    """Model of the loss in foliage."""
    trunk_loss_db: _Decibels = 3.0
    """Loss per trunk that the line of sight crosses."""
    wall_loss_db: _Decibels = 12.0
    """Loss per surface of a solid that the line of sight crosses."""
    ground_loss_db: _Decibels = 40.0
    """Loss if the ground blocks the line of sight."""
    latency_s: NonNegative = 0.002
    """Latency of radio and driver, in addition to queue and time on the air."""
    retries: Annotated[int, Field(ge=0, le=7)] = 3
    """Repetitions of a frame for one station; frames for many are sent once."""
    queue_s: Positive = 0.2
    """Frames that would wait longer for the channel are dropped."""
    update_s: _Interval = 0.25
    """Time for which obstacles between two stations count as constant."""

    @model_validator(mode="after")
    def _topics_are_unique(self) -> Self:
        names = [topic.name for topic in self.topics]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"radio.topics: named twice: {', '.join(twice)}")
        return self
