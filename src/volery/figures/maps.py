"""Maps as PNG: the forest with the paths, and the LIDAR map from above and in oblique view."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.colors import LightSource, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from volery.figures.flight_data import FlightData, Ground, Structures, Trees
from volery.figures.palette import uav_color

_DPI = 110
_WIDTH = 11.0
_TOP_MARGIN_M = 35.0
_NIGHT = "#10151b"
_NIGHT_INK = "#c9d1d9"
_GROUND = LinearSegmentedColormap.from_list("ground", ["#dfe5d3", "#f1eee0", "#e6d9c2"])
_GROUND_RETURN = (70, 81, 94)
_ASPECT = 1.15
"""Min width over height of a map."""
_DARKEST = 0.25
"""Start of the colour scale for plants: darker colours are invisible on the dark background."""
_TREE_M = 0.6
"""Height above ground above which LIDAR points count as plants."""
_LABEL = (44.0, 14.0)
"""Width and height in points that a UAV's name takes."""

Box = tuple[float, float, float, float]


def top_view(flight: FlightData) -> bytes:
    """Draws terrain, solids, trees by the size of their crowns, and the paths; returns PNG."""
    figure, axes = _map(_frame(flight, _TOP_MARGIN_M), "white")
    draw_top_view(axes, flight)
    return _png(figure)


def draw_top_view(axes: Axes, flight: FlightData) -> None:
    """Draws terrain, solids, trees by the size of their crowns, and the paths."""
    box = _frame(flight, _TOP_MARGIN_M)
    _set_view(axes, box, "white")
    _draw_ground(axes, flight.ground, box)
    if flight.structures is not None:
        _draw_structures(axes, flight.structures, box)
    if flight.trees is not None:
        _draw_trees(axes, flight.trees, box)
    _draw_paths(axes, flight, outline="white")
    _draw_contacts(axes, flight)
    _scale_bar(axes, box, "#222222", "white")


def lidar_view(flight: FlightData) -> bytes | None:
    """Draws LIDAR points from above, coloured by height, with the paths; None without points."""
    if flight.lidar is None:
        return None
    box = _frame(flight, margin_m=30.0)
    lidar = flight.lidar
    plant = lidar.height_m > _TREE_M
    norm = Normalize(0.0, _tall(lidar.height_m[plant]), clip=True)
    pixel = max(lidar.voxel_m, (box[2] - box[0]) / (_WIDTH * _DPI * 1.2))
    image = np.zeros((*_shape(box, pixel), 4), np.uint8)
    ground = _raster(lidar.points_map[~plant], lidar.height_m[~plant], box, pixel)
    image[np.isfinite(ground)] = (*_GROUND_RETURN, 255)
    tops = _raster(lidar.points_map[plant], lidar.height_m[plant], box, pixel)
    seen = np.isfinite(tops)
    image[seen] = colormaps["viridis"](
        _DARKEST + (1.0 - _DARKEST) * np.asarray(norm(tops[seen])), bytes=True
    )
    figure, axes = _map(box, _NIGHT)
    axes.imshow(image, extent=(box[0], box[2], box[1], box[3]), origin="lower", zorder=1)
    _draw_paths(axes, flight, outline=_NIGHT)
    _draw_contacts(axes, flight)
    _scale_bar(axes, box, _NIGHT_INK, _NIGHT)
    _height_key(figure, norm)
    return _png(figure)


def aslant_view(flight: FlightData) -> bytes | None:
    """Draws LIDAR points obliquely from the south, near ones over far ones; None without points."""
    if flight.lidar is None:
        return None
    lidar = flight.lidar
    box = _frame(flight, margin_m=22.0)
    keep = _inside(lidar.points_map, box, 0.0)
    points, height = lidar.points_map[keep], lidar.height_m[keep]
    if len(points) == 0:
        return None
    width, depth = box[2] - box[0], box[3] - box[1]
    tilt = np.radians(38.0)
    pixels_x = int(_WIDTH * _DPI)
    pixel = width / pixels_x
    base = float(np.quantile(points[:, 2], 0.02))

    def project(p: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        u = (p[:, 0] - box[0]) / pixel
        v = ((p[:, 1] - box[1]) * np.sin(tilt) + (p[:, 2] - base) * np.cos(tilt)) / pixel
        return u, v

    u, v = (a.astype(np.int32) for a in project(points))
    rows = max(int(np.quantile(v, 0.9999)) + 12, 40)
    # the southernmost point of every pixel hides the others
    front = np.full((rows, pixels_x), -1, np.int32)
    order = np.argsort(-points[:, 1], kind="stable").astype(np.int32)
    size = max(1, round(lidar.voxel_m / pixel))
    for du in range(size):
        for dv in range(size):
            inside = (u + du >= 0) & (u + du < pixels_x) & (v + dv >= 0) & (v + dv < rows)
            seen = order[inside[order]]
            front[v[seen] + dv, u[seen] + du] = seen
    image = np.empty((rows, pixels_x, 3), np.uint8)
    image[:] = [int(_NIGHT[k : k + 2], 16) for k in (1, 3, 5)]
    shown = front >= 0
    tall, south = height[front[shown]], points[front[shown], 1]
    norm = Normalize(0.0, _tall(height[height > _TREE_M]), clip=True)
    colors = colormaps["viridis"](_DARKEST + (1.0 - _DARKEST) * np.asarray(norm(tall)), bytes=True)[
        :, :3
    ]
    colors = np.where(tall[:, None] <= _TREE_M, np.array(_GROUND_RETURN), colors)
    image[shown] = colors * (1.0 - 0.45 * (south - box[1]) / depth)[:, None]
    figure = Figure(figsize=(_WIDTH, _WIDTH * len(image) / pixels_x), facecolor=_NIGHT)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.imshow(image, origin="lower", interpolation="nearest", aspect="auto")
    axes.set_xlim(0, pixels_x)
    axes.set_ylim(0, len(image))
    for number, uav in enumerate(flight.uavs):
        if len(uav.position_map):
            pu, pv = project(uav.position_map)
            axes.plot(pu, pv, color=uav_color(number), linewidth=1.6, alpha=0.95)
    axes.set_axis_off()
    return _png(figure)


def _frame(flight: FlightData, margin_m: float) -> Box:
    """Returns the rectangle to show: the paths with a margin, inside the world, not too slim."""
    x0, y0, x1, y1 = flight.ground.bounds
    tracks = [uav.position_map[:, :2] for uav in flight.uavs if len(uav.position_map)]
    if not tracks:
        return x0, y0, x1, y1
    flown = np.concatenate(tracks)
    low, high = flown.min(axis=0) - margin_m, flown.max(axis=0) + margin_m
    size = high - low
    size = np.maximum(size, (_ASPECT * size[1], 0.45 * size[0]))
    # inside the world if it is large enough, else around the paths
    world_low, world_high = np.array([x0, y0]), np.array([x1, y1])
    min_size = flown.max(axis=0) - flown.min(axis=0) + 10.0
    size = np.maximum(np.minimum(size, world_high - world_low), min_size)
    middle = (low + high) / 2.0
    low = np.clip(middle - size / 2.0, world_low, np.maximum(world_high - size, world_low))
    low = np.clip(low, flown.max(axis=0) + 5.0 - size, flown.min(axis=0) - 5.0)
    high = low + size
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _map(box: Box, background: str) -> tuple[Figure, Axes]:
    height = _WIDTH * (box[3] - box[1]) / (box[2] - box[0])
    figure = Figure(figsize=(_WIDTH, min(height, _WIDTH * 1.25)), facecolor=background)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    _set_view(axes, box, background)
    return figure, axes


def _set_view(axes: Axes, box: Box, background: str) -> None:
    axes.set_facecolor(background)
    axes.set_xlim(box[0], box[2])
    axes.set_ylim(box[1], box[3])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _draw_ground(axes: Axes, ground: Ground, box: Box) -> None:
    heights, spacing = ground.heights, ground.spacing_m
    x0, y0 = ground.origin
    relief = float(np.ptp(heights))
    rows, columns = heights.shape
    half = spacing / 2.0
    extent = (x0 - half, x0 + (columns - 0.5) * spacing, y0 - half, y0 + (rows - 0.5) * spacing)
    if relief < 1e-6:
        axes.set_facecolor(_GROUND(0.4))
        axes.imshow(
            [[_GROUND(0.4)]], extent=(box[0], box[2], box[1], box[3]), aspect="equal", zorder=0
        )
    else:
        shaded = LightSource(315.0, 40.0).shade(
            heights[::-1], _GROUND, blend_mode="soft", vert_exag=4.0, dx=spacing, dy=spacing
        )
        axes.imshow(shaded, extent=extent, origin="upper", interpolation="bilinear", zorder=0)
        step = _round_step(relief / 10.0)
        levels = np.arange(np.floor(heights.min() / step) * step, heights.max() + step, step)
        x = x0 + spacing * np.arange(columns)
        y = y0 + spacing * np.arange(rows)
        lines = axes.contour(x, y, heights, levels, colors="#8c7f66", linewidths=0.6, alpha=0.75)
        axes.clabel(lines, levels[::2], fontsize=8, fmt="%g m", inline_spacing=3)
    axes.set_xlim(box[0], box[2])
    axes.set_ylim(box[1], box[3])


def _draw_structures(axes: Axes, structures: Structures, box: Box) -> None:
    tops, edges = (
        lines[_inside(lines.mean(axis=1), box, 60.0)]
        for lines in (structures.tops, structures.edges)
    )
    axes.add_collection(
        PolyCollection(list(tops), facecolors="#b9b2a8", edgecolors="#b9b2a8", linewidths=0.3)
    )
    axes.add_collection(LineCollection(list(edges), colors="#6f675c", linewidths=0.7))


def _draw_trees(axes: Axes, trees: Trees, box: Box) -> None:
    foot = trees.position_map
    near = _inside(foot, box, 12.0)
    crowns = 2.0 * trees.crown_radius_m[near]
    trunks = np.maximum(trees.dbh_m[near], 0.15)
    for widths, style in (
        (crowns, {"facecolors": "#3f7d4a", "alpha": 0.28, "edgecolors": "#2c5c35"}),
        (trunks, {"facecolors": "#4a3222", "alpha": 0.9, "edgecolors": "none"}),
    ):
        axes.add_collection(
            EllipseCollection(
                widths,
                widths,
                0.0,
                units="xy",
                offsets=foot[near, :2],
                transOffset=axes.transData,
                linewidths=0.4,
                **style,
            )
        )


def _draw_paths(axes: Axes, flight: FlightData, outline: str) -> None:
    thin = len(flight.uavs) > 12
    ends = [uav.position_map[-1, :2] for uav in flight.uavs if len(uav.position_map)]
    shifts = iter(_label_shifts(np.array(ends), axes))
    for number, uav in enumerate(flight.uavs):
        if not len(uav.position_map):
            continue
        line = uav.position_map[:, :2]
        color = uav_color(number)
        for width, shade, order in ((4.2, outline, 4), (2.3, color, 5)):
            axes.add_collection(
                LineCollection(
                    [line],
                    linewidths=width * (0.6 if thin else 1.0),
                    colors=[shade],
                    alpha=0.9,
                    capstyle="round",
                    zorder=order,
                )
            )
        axes.plot(*line[0], "o", ms=8, mfc=outline, mec=color, mew=2.2, zorder=6)
        axes.plot(*line[-1], "o", ms=9, mfc=color, mec=outline, mew=1.6, zorder=6)
        if not thin:
            axes.annotate(
                uav.name,
                line[-1],
                xytext=(9, next(shifts)),
                textcoords="offset points",
                fontsize=12,
                fontweight="bold",
                color=color,
                zorder=8,
                path_effects=[withStroke(linewidth=3.5, foreground=outline)],
            )


def _label_shifts(ends: NDArray[np.floating], axes: Axes) -> list[float]:
    """Returns how far, in points, labels at ends of paths (n, 2) move up so that none overlap."""
    pixels = axes.transData.transform(ends) if len(ends) else np.zeros((0, 2))
    points = pixels * 72.0 / axes.figure.dpi
    placed: list[tuple[float, float]] = []
    shifts = []
    for x, y in points:
        shift = next(
            up
            for up in _label_levels()
            if all(abs(x - px) > _LABEL[0] or abs(y + up - py) > _LABEL[1] for px, py in placed)
        )
        placed.append((x, y + shift))
        shifts.append(shift)
    return shifts


def _label_levels() -> Iterator[float]:
    """Yields shifts in points: beside the end, then alternately below and above."""
    yield 6.0
    for level in itertools.count(1):
        yield 6.0 - level * _LABEL[1]
        yield 6.0 + level * _LABEL[1]


def _draw_contacts(axes: Axes, flight: FlightData) -> None:
    for event in flight.events:
        if event.is_contact and event.position_map is not None:
            x, y, _ = event.position_map
            axes.plot(x, y, "X", ms=12, mfc="#e03131", mec="white", mew=1.4, zorder=7)


def _scale_bar(axes: Axes, box: Box, ink: str, outline: str) -> None:
    width = box[2] - box[0]
    length = _round_step(width / 6.0)
    x, y = box[0] + 0.025 * width, box[1] + 0.03 * (box[3] - box[1])
    stroke = [withStroke(linewidth=4.0, foreground=outline)]
    axes.plot([x, x + length], [y, y], color=ink, lw=2.5, zorder=9, path_effects=stroke)
    text: dict[str, Any] = {"fontsize": 11, "color": ink, "zorder": 9, "path_effects": stroke}
    axes.annotate(f"{length:g} m", (x, y), (0, 6), textcoords="offset points", **text)
    axes.annotate(
        "N",
        xy=(0.972, 0.965),
        xytext=(0.972, 0.905),
        xycoords="axes fraction",
        ha="center",
        va="top",
        arrowprops={"arrowstyle": "-|>", "color": ink, "lw": 1.8},
        **text,
    )


def _height_key(figure: Figure, norm: Normalize) -> None:
    axes = figure.add_axes((0.77, 0.035, 0.2, 0.012))
    ramp = np.linspace(_DARKEST, 1.0, 128)[None, :]
    extent = (0.0, float(norm.vmax or 1.0), 0.0, 1.0)
    axes.imshow(ramp, aspect="auto", cmap="viridis", vmin=0.0, vmax=1.0, extent=extent)
    axes.set_yticks([])
    axes.tick_params(colors=_NIGHT_INK, labelsize=9, length=2, top=True, labeltop=True)
    axes.tick_params(bottom=False, labelbottom=False)
    axes.set_title("height above ground, m", fontsize=10, color=_NIGHT_INK, pad=4)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _inside(points: NDArray[np.floating], box: Box, margin_m: float) -> NDArray[np.bool_]:
    x, y = points[:, 0], points[:, 1]
    across = (x >= box[0] - margin_m) & (x <= box[2] + margin_m)
    inside: NDArray[np.bool_] = across & (y >= box[1] - margin_m) & (y <= box[3] + margin_m)
    return inside


def _shape(box: Box, pixel: float) -> tuple[int, int]:
    return int((box[3] - box[1]) / pixel) + 1, int((box[2] - box[0]) / pixel) + 1


def _raster(
    points: NDArray[np.floating], height: NDArray[np.floating], box: Box, pixel: float
) -> NDArray[np.float64]:
    """Returns the max height in every pixel; -inf in empty ones."""
    image = np.full(_shape(box, pixel), -np.inf)
    keep = _inside(points, box, 0.0)
    column = ((points[keep, 0] - box[0]) / pixel).astype(np.int64)
    row = ((points[keep, 1] - box[1]) / pixel).astype(np.int64)
    np.maximum.at(image, (row, column), height[keep])
    return image


def _tall(heights: NDArray[np.floating]) -> float:
    return max(float(np.quantile(heights, 0.98)), 1.0) if len(heights) else 1.0


def _round_step(value: float) -> float:
    """Returns the largest of 1, 2, 5 times a power of ten that is not above `value`."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(m * power for m in (1.0, 2.0, 5.0) if m * power <= value * 1.0001))


def _png(figure: Figure) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI)
    figure.clear()
    return file.getvalue()
