"""Rays of an image: the same with any number of lanes in a packet, of which CPUs differ."""

import numpy as np
import pytest

from volery.sensors.cameras import pixel_table


def table_with(lanes, samples, monkeypatch):
    monkeypatch.setattr(pixel_table, "LANES", lanes)
    monkeypatch.setattr(pixel_table, "PIECE", 2048 // lanes)
    distortion = (-0.3, 0.1, 0.001, 0.0, 0.0)
    return pixel_table.make_table(37, 22, 25.0, (18.0, 11.5), distortion, samples, 20_000_000)


@pytest.mark.parametrize("samples", [1, 4])
def test_rays_do_not_depend_on_the_lanes_of_a_packet(samples, monkeypatch):
    wide, narrow = (table_with(lanes, samples, monkeypatch) for lanes in (16, 8))
    for table, lanes in ((wide, 16), (narrow, 8)):
        packets = len(table.direction)
        assert table.direction.shape == (packets, 3, lanes)
        assert table.pixel.shape == table.blind.shape == (packets, lanes)
        assert table.after_ns.shape == (packets,)
    np.testing.assert_array_equal(
        wide.direction.swapaxes(1, 2).reshape(-1, 3), narrow.direction.swapaxes(1, 2).reshape(-1, 3)
    )
    np.testing.assert_array_equal(wide.pixel.ravel(), narrow.pixel.ravel())
    np.testing.assert_array_equal(wide.blind.ravel(), narrow.blind.ravel())
    np.testing.assert_array_equal(np.repeat(wide.after_ns, 2), narrow.after_ns)
    np.testing.assert_allclose(wide.cone, narrow.cone)


@pytest.mark.parametrize("lanes", [8, 16])
def test_each_pixel_is_written_once_by_the_rays_through_it(lanes, monkeypatch):
    table = table_with(lanes, 4, monkeypatch)
    firsts = table.pixel[:, ::4].ravel()
    assert sorted(firsts[firsts >= 0]) == list(range(37 * 22))
    assert len(np.unique(table.after_ns)) == -(-22 // 2)
