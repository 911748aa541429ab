"""Beam patterns against their data sheets and formulas: elevations, times, order, coverage."""

import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.sensors.lidar.beam_table import KNOTS_APART_NS, LANES
from volery.sensors.lidar.lidar_model import load_lidar

RINGS = {"vlp_16": 16, "hdl_32e": 32, "os1_64": 64, "os1_128": 128}
MODELS = ["utm_30lx", "utm_30lx_ew", *RINGS, "mid_40"]


def angles_of(model, sweep=0):
    """Azimuth and elevation of each beam, deg."""
    x, y, z = model.scan.directions(sweep)
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


@pytest.mark.parametrize("name", MODELS)
def test_every_table_casts_every_beam_once_at_its_own_time(name):
    model = load_lidar(name)
    table, pattern = model.scan.table(0), model.scan
    np.testing.assert_array_equal(np.sort(table.beam[: model.beams]), np.arange(model.beams))
    direction = pattern.directions(0)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=0), 1.0, atol=1e-12)
    rays = table.lanes.swapaxes(0, 1).reshape(4, -1)[:, : model.beams]
    fraction = rays[3]
    np.testing.assert_array_equal(rays[:3], direction[:, table.beam[: model.beams]])
    assert fraction.min() >= 0.0
    assert fraction.max() <= 1.0
    knots = table.knot_ns[np.arange(model.beams) // LANES]
    time = knots[:, 0] + fraction * (knots[:, 1] - knots[:, 0])
    np.testing.assert_allclose(time, pattern.time_ns[table.beam[: model.beams]], atol=1.01)
    assert model.sweep_duration_ns <= 1e9 / pattern.rate_hz
    # A pose is looked up at least every 2 ms, so that the straight line between two is exact.
    assert (table.knot_ns[:, 1] - table.knot_ns[:, 0]).max() <= 2_000_000


def test_packets_of_a_planar_sweep_share_knots_within_a_millisecond():
    knots = load_lidar().scan.table(0).knot_ns
    start = np.unique(knots[:, 0])
    assert (knots[:, 1] - knots[:, 0]).max() <= KNOTS_APART_NS
    assert len(start) <= len(knots) / 3 + 1
    assert (np.diff(start) > 0.5 * KNOTS_APART_NS).all()
    np.testing.assert_array_equal(np.unique(knots[:, 1])[:-1], start[1:])


@pytest.mark.parametrize(("name", "rings"), RINGS.items())
def test_packets_of_ring_scanners_run_close_together(name, rings):
    table = load_lidar(name).scan.table(0)
    packets = table.lanes[:, :3].swapaxes(0, 1)
    cosine = np.einsum("ipk,ip->pk", packets, packets[:, :, 0]).min(axis=1)
    # Some staggered or ragged tiles are wide; the most must pass Embree's coherent traversal.
    assert (cosine > 0.9).mean() > 0.98
    assert len(set(load_lidar(name).scan.ring.tolist())) == rings


def test_the_vlp_16_fires_as_its_manual_says():
    model = load_lidar("vlp_16")
    scan = model.scan
    _, elevation = angles_of(model)
    column = slice(0, 16)
    np.testing.assert_allclose(elevation[column], np.arange(-15, 16, 2), atol=1e-9)
    np.testing.assert_array_equal(scan.ring[column], np.arange(16))
    fired = elevation[column][np.argsort(scan.time_ns[column])]
    np.testing.assert_allclose(
        fired, [-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15]
    )
    assert np.diff(np.sort(scan.time_ns[column])) == pytest.approx(2304)
    assert scan.time_ns[16] == 55_296
    assert scan.time_ns[-16] == pytest.approx(1807 * 55_296, abs=1)


def test_a_head_turns_clockwise_while_its_lasers_fire():
    model = load_lidar("vlp_16")
    azimuth, _ = angles_of(model)
    turned = (180.0 - azimuth) % 360.0
    rate_deg_s = 3600.0
    np.testing.assert_allclose(turned, model.scan.time_ns * 1e-9 * rate_deg_s, atol=1e-5)


def test_the_hdl_32e_fires_as_its_manual_says():
    model = load_lidar("hdl_32e")
    _, elevation = angles_of(model)
    fired = elevation[:32][np.argsort(model.scan.time_ns[:32])]
    np.testing.assert_allclose(fired[:6], [-30.67, -9.33, -29.33, -8.0, -28.0, -6.66])
    np.testing.assert_allclose(fired[-2:], [-10.67, 10.67])
    assert np.diff(np.sort(model.scan.time_ns[:32])) == pytest.approx(1152, abs=1)


@pytest.mark.parametrize(("name", "top"), [("os1_64", 16.6), ("os1_128", 22.5)])
def test_ouster_rings_go_down_from_the_top_and_a_column_fires_at_once(name, top):
    model = load_lidar(name)
    rings = RINGS[name]
    _, elevation = angles_of(model)
    column = elevation[:rings]
    assert (column[0], column[-1]) == (pytest.approx(top), pytest.approx(-top))
    assert (np.diff(column) < 0).all()
    times = model.scan.time_ns.reshape(1024, rings)
    assert (times == times[:, :1]).all()
    np.testing.assert_allclose(times[:, 0], np.arange(1024) * 97_656.25, atol=0.51)


# ----------------------------------------------------------------------------------------- rosette


def test_a_rosette_fills_its_circular_field_of_view():
    model = load_lidar("mid_40")
    x, _, _ = model.scan.directions(0)
    off_axis = np.degrees(np.arccos(x))
    assert off_axis.max() == pytest.approx(19.2, abs=0.01)
    assert off_axis.min() < 0.2
    assert model.beams == 10_000


def test_a_rosette_is_the_sum_of_two_turning_prisms():
    model = load_lidar("mid_40")
    for sweep in (0, 7, 1234):
        t = sweep * 0.1 + np.arange(10_000) * 1e-5
        y = z = 0.0
        for rpm in (7294.0, -4664.0):
            y = y + np.radians(9.6) * np.cos(2 * np.pi * rpm / 60 * t)
            z = z + np.radians(9.6) * np.sin(2 * np.pi * rpm / 60 * t)
        rho = np.hypot(y, z)
        want = np.stack([np.cos(rho), np.sin(rho) * y / rho, np.sin(rho) * z / rho])
        np.testing.assert_allclose(model.scan.directions(sweep), want, atol=1e-8)


def test_a_rosette_does_not_repeat_within_ten_seconds():
    scan = load_lidar("mid_40").scan
    first = scan.directions(0)
    apart = [np.abs(scan.directions(sweep) - first).max() for sweep in range(1, 100)]
    assert min(apart) > np.radians(1.0)
    # Both prisms are back after 30 s: 3647 and 2332 turns.
    np.testing.assert_allclose(scan.directions(300), first, atol=1e-9)


def coverage(scan, sweeps, cell_deg=0.28):
    """Fraction of the field of view's cells that a beam has met: the beam's longer divergence."""
    half = 19.2
    edges = np.arange(-half, half + cell_deg, cell_deg)
    hit = np.zeros((len(edges) - 1,) * 2, dtype=bool)
    for sweep in range(sweeps):
        x, y, z = scan.directions(sweep)
        scale = np.degrees(np.arccos(x)) / np.hypot(y, z)
        hit |= np.histogram2d(y * scale, z * scale, bins=[edges, edges])[0] > 0
    middle = (edges[:-1] + edges[1:]) / 2
    inside = np.hypot(middle[:, None], middle[None, :]) < half - cell_deg
    return hit[inside].mean()


def test_coverage_grows_with_integration_time_to_the_whole_field_of_view():
    scan = load_lidar("mid_40").scan
    fractions = [coverage(scan, sweeps) for sweeps in (1, 2, 5, 10, 30)]
    np.testing.assert_allclose(fractions, [0.20, 0.37, 0.71, 0.93, 1.0], atol=0.01)


# ------------------------------------------------------------------------------------ users' files

TABLE = """\
name = "mine"
[scan]
kind = "table"
rate_hz = 10.0
file = "beams.csv"
[range]
min_m = 0.1
max_m = 50.0
resolution_m = 0.001
[noise]
floor_m = 0.01
slope = 0.0
offset_m = 0.0
[dropout]
far = 0.0
grazing = 0.0
[mixed_pixels]
divergence_rad = 0.001
least_jump_m = 0.1
pulse_length_m = 1.0
first_echo_share = 0.1
"""


def table_model(tmp_path, rows, head="azimuth_deg,elevation_deg,time_s,ring"):
    (tmp_path / "mine.toml").write_text(TABLE)
    (tmp_path / "beams.csv").write_text("\n".join([head, *rows]) + "\n")
    return load_lidar(tmp_path / "mine.toml")


def test_a_table_of_beams_is_taken_as_it_stands(tmp_path):
    rows = ["0,0,0,3", "90,0,0.01,3", "0,45,0.02,4", "-90,-30,0.05,4"]
    model = table_model(tmp_path, rows)
    azimuth, elevation = angles_of(model)
    np.testing.assert_allclose(azimuth, [0, 90, 0, -90], atol=1e-9)
    np.testing.assert_allclose(elevation, [0, 0, 45, -30], atol=1e-9)
    np.testing.assert_array_equal(model.scan.time_ns, [0, 10_000_000, 20_000_000, 50_000_000])
    np.testing.assert_array_equal(model.scan.ring, [3, 3, 4, 4])
    np.testing.assert_array_equal(model.without_noise().scan.ring, [3, 3, 4, 4])
    without = table_model(tmp_path, ["0,0,0", "1,1,0"], "azimuth_deg,elevation_deg,time_s")
    np.testing.assert_array_equal(without.scan.ring, [0, 0])


@pytest.mark.parametrize(
    ("head", "rows"),
    [
        ("sep=;\nazimuth_deg;elevation_deg;time_s;ring", ["0,5;0;0;3", "90;-2,5;0,01;4"]),
        ("Azimuth (deg)\tElevation (deg)\tTime [s]\tNote\tRing", ["0.5\t0\t0\ta\t3",
         "90\t-2.5\t0.01\t\t4"]),
        ("# azimuth_deg elevation_deg time_s ring", ["5e-1 0 0 3.0", "90 -2.5 0.01 4.0"]),
    ],
)  # fmt: skip
def test_a_table_of_beams_as_spreadsheets_and_numpy_write_it(tmp_path, head, rows):
    model = table_model(tmp_path, rows, head)
    azimuth, elevation = angles_of(model)
    np.testing.assert_allclose(azimuth, [0.5, 90.0], atol=1e-9)
    np.testing.assert_allclose(elevation, [0.0, -2.5], atol=1e-9)
    np.testing.assert_array_equal(model.scan.time_ns, [0, 10_000_000])
    np.testing.assert_array_equal(model.scan.ring, [3, 4])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["0,0,0,1"], "1 beam; allowed are 2"),
        (["0,0,0,1", "0,x,0,1"], "row 3: every entry must be a number"),
        (["0,0,0,1", "0,91,0,1"], "elevation_deg within"),
        (["0,0,0.02,1", "0,0,0.01,1"], "beam 2: time_s must not"),
        (["0,0,-0.01,1", "0,0,0.01,1"], "beam 1: time_s must not"),
        (["0,0,0,1", "0,0,0.2,1"], "at most"),
        (["0,0,0,1", "0,0,nan,1"], "finite"),
        (["0,0,0,1", "0,0,0,-1"], "ring within"),
    ],
)
def test_a_broken_table_is_refused(tmp_path, rows, message):
    with pytest.raises(DataFileError, match=message):
        table_model(tmp_path, rows)


def test_a_table_needs_its_file_and_columns(tmp_path):
    with pytest.raises(DataFileError, match="must name the columns azimuth_deg"):
        table_model(tmp_path, ["0,0"], "azimuth,elevation")
    (tmp_path / "beams.csv").unlink()
    with pytest.raises(DataFileError, match=r"beams\.csv: cannot be read"):
        load_lidar(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"elevation_deg": [0.0] * 16, "firing_offset_s": [0.0] * 3}, "one entry per ring"),
        ({"columns": 2000}, "fit in one turn"),
        ({"azimuth_step_deg": 0.0}, "must not be 0"),
        ({"columns": 100_000, "column_period_s": 1e-7}, "rings times columns"),
    ],
)
def test_broken_rings_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        load_lidar("vlp_16").changed(scan=changes)
