"""The numbers, tables and drawings of a made-up flight of two UAVs."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from volery.core.data_frames import data_frame
from volery.core.errors import VoleryError
from volery.engine.events import Event, EventKind
from volery.results import FlightResult


@pytest.fixture
def result() -> FlightResult:
    """uav1 flies 10 m along x within 10 s, guest appears beside it at 5 s and crashes."""
    t = 11
    position = np.zeros((2, t, 3))
    position[0, :, 0] = np.arange(t)
    position[1, :, 0], position[1, :, 1] = np.arange(t), 3.0
    velocity = np.zeros((2, t, 3))
    velocity[:, :, 0] = 1.0
    attitude = np.tile([0.0, 0.0, 0.0, 1.0], (2, t, 1))
    mode = np.full((2, t), 2, np.int8)
    mode[1, -1] = 8
    for array in (position, velocity, attitude):
        array[1, :5] = np.nan
    mode[1, :5] = -1
    battery = np.ones((2, t))
    hit = Event(9_500_000_000, "guest", EventKind.COLLISION, (9.5, 3.0, 0.0), 1.0, partner="tree 3")
    note = Event(0, "uav1", EventKind.MODE, (0.0, 0.0, 0.0), 0.0, detail="changed to HOLD")
    return FlightResult(
        "made_up",
        7,
        ("uav1", "guest"),
        np.arange(t, dtype=np.float64),
        position,
        velocity,
        attitude,
        np.zeros((2, t, 3)),
        battery,
        mode,
        (note, hit),
    )


def test_numbers_of_the_flight(result):
    assert result.duration_s == 10.0
    assert result.distance_m.tolist() == [10.0, 5.0]
    assert result.crashed.tolist() == [False, True]
    assert [event.partner for event in result.contacts] == ["tree 3"]
    assert np.isinf(result.separation_m[:5]).all()
    assert (result.separation_m[5:] == 3.0).all()
    assert result.summary() == {
        "scenario": "made_up",
        "seed": 7,
        "uavs": 2,
        "duration_s": 10.0,
        "contacts": 1,
        "crashed": 1,
        "distance_m": 7.5,
        "max_speed_m_s": 1.0,
        "min_separation_m": 3.0,
    }


def test_one_uav_has_no_separation(result):
    alone = replace(
        result,
        uavs=("uav1",),
        position_map=result.position_map[:1],
        velocity_map=result.velocity_map[:1],
        mode=result.mode[:1],
    )
    assert np.isinf(alone.separation_m).all()
    assert np.isnan(alone.summary()["min_separation_m"])


def test_one_uav(result):
    guest = result["guest"]
    assert guest.position_map.shape == (11, 3)
    assert guest.position_map[-1].tolist() == [10.0, 3.0, 0.0]
    assert list(result) == ["uav1", "guest"]
    assert len(result) == 2
    with pytest.raises(VoleryError, match="the flight has no UAV 'uav2'; it has uav1, guest"):
        result["uav2"]
    assert repr(result) == ("FlightResult('made_up', seed 7: 2 UAVs, 11 samples, 10 s, 1 contact)")


def test_tables(result):
    table = result.to_pandas()
    assert len(table) == 11 + 6
    assert table.groupby("uav").x_m.count().to_dict() == {"guest": 6, "uav1": 11}
    assert table[table.uav == "guest"].time_s.tolist() == [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]
    assert table["mode"].iloc[-1] == "CRASHED"
    assert not table.isna().any().any()
    assert list(table.columns[:5]) == ["time_s", "uav", "x_m", "y_m", "z_m"]
    events = result.events_to_pandas()
    assert events.kind.tolist() == ["mode", "collision"]
    assert events.time_s.tolist() == [0.0, 9.5]
    assert events.x_m.tolist() == [0.0, 9.5]


def test_drawings(result):
    from matplotlib.figure import Figure

    axes = result.plot_over_time("x", Figure().add_subplot())
    assert [line.get_label() for line in axes.lines] == ["uav1", "guest"]
    assert axes.lines[0].get_ydata().tolist() == list(range(11))
    top = result.plot(Figure().add_subplot())
    assert {"uav1", "guest"} <= {text.get_text() for text in top.texts}
    assert result._repr_png_().startswith(b"\x89PNG")
    assert "<b>made_up</b>, seed 7: 2 UAVs, 10 s, 1 contact" in result._repr_html_()
    with pytest.raises(VoleryError, match="cannot draw 'mood' over time: use height, x, y, speed"):
        result.plot_over_time("mood")


def test_missing_packages_are_one_line_with_the_command(monkeypatch, result):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        VoleryError, match=r'^to_pandas\(\) needs pandas: pip install "volery\[pandas\]"$'
    ):
        result.to_pandas()
    with pytest.raises(VoleryError, match=r"pip install"):
        data_frame({"a": [1]})


def test_progress_without_tqdm_is_one_line_with_the_command(monkeypatch):
    from volery.runtime.monitoring.progress_bar import progress_bar

    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with (
        pytest.raises(
            VoleryError, match=r'^progress=True needs tqdm: pip install "volery\[progress\]"$'
        ),
        progress_bar("flight"),
    ):
        pass
