"""The radio of a scenario: what UAVs tell each other by it, and how well it carries."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, NonNegative, Positive, Topic

_Decibels = Annotated[float, Field(ge=0.0, le=200.0)]
_Interval = Annotated[float, Field(ge=1e-3)]


class RelayedTopic(Data):
    """A topic of each UAV that its radio sends to all others, who hear it as `radio/NAME`."""

    name: Topic
    """Below the UAV's name."""
    type: Annotated[str, Field(pattern=r"^\w+/msg/\w+$")]
    """Such as `std_msgs/msg/String`; a message tells itself who sends it."""


class Radio(Data):
    """A packet radio on every UAV whose type has one; all share one channel.

    The defaults are those of a small 2.4 GHz module at the lowest rate of IEEE 802.11a/g: 6 Mbit/s
    of BPSK in 20 MHz at 100 mW; where no source stands they are modelling choices.
    """

    links: Literal["modelled", "ideal"] = "modelled"
    """Ideal ones lose nothing and take no time."""
    topics: tuple[RelayedTopic, ...] = ()
    frequency_mhz: Annotated[float, Field(ge=100.0, le=6000.0)] = 2437.0
    """Channel 6 of IEEE 802.11."""
    power_dbm: Annotated[float, Field(ge=-30.0, le=50.0)] = 20.0
    antenna_gain_dbi: Annotated[float, Field(ge=-20.0, le=30.0)] = 2.0
    """Of each antenna, the same in all directions."""
    bandwidth_mhz: Positive = 20.0
    noise_figure_db: _Decibels = 6.0
    bit_rate_mbit_s: Positive = 6.0
    exponent: Annotated[float, Field(ge=1.0, le=6.0)] = 2.0
    """Of the path loss over distance; 2: free space."""
    shadowing_db: _Decibels = 3.0
    """Standard deviation of the slow fading of a pair."""
    shadowing_s: _Interval = 1.0
    """For so long the slow fading of a pair stays as it is."""
    vegetation: Literal["p833", "weissberger", "none"] = "p833"
    """Law of the loss in foliage."""
    trunk_loss_db: _Decibels = 3.0
    wall_loss_db: _Decibels = 12.0
    """Of each surface of a solid that the line of sight crosses."""
    ground_loss_db: _Decibels = 40.0
    """Where the ground stands in the line of sight."""
    latency_s: NonNegative = 0.002
    """Of radio and driver, beside queue and time on the air."""
    retries: Annotated[int, Field(ge=0, le=7)] = 3
    """Repetitions of a frame for one station; frames for many are sent once."""
    queue_s: Positive = 0.2
    """What would have to wait longer for the channel is dropped."""
    update_s: _Interval = 0.25
    """For so long what stands between two stations is taken to be the same."""

    @model_validator(mode="after")
    def _topics_are_unique(self) -> Self:
        names = [topic.name for topic in self.topics]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"radio.topics: named twice: {', '.join(twice)}")
        return self
