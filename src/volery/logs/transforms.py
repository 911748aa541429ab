"""The transforms of a log: `/tf` and `/tf_static` as poses of one frame in another over time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import VoleryError
from volery.graph.messages import frame_name, frame_of, stamp_of
from volery.logs.topic_data import LoggedMessage

_DEEPEST = 64
"""Max number of frames in a chain."""


class Transforms(NamedTuple):
    """Poses of a frame in another at n times: p_parent = rotate(attitude, p_child) + position."""

    times_s: Array
    """(n,) stamps, s."""
    position: Array
    """(n, 3) m."""
    attitude: Array
    """(n, 4) quaternions x y z w; nan (and positions, too) before the first transform."""


class _Edge(NamedTuple):
    """Transforms of a frame in its parent; one of any time if it is static."""

    parent: str
    times_s: Array
    poses: Array
    """(n, 7) position, attitude"""
    is_static: bool

    def at(self, times_s: Array) -> tuple[Array, Array]:
        """Interpolates position (m, 3) and attitude (m, 4); nan outside of the transforms."""
        if self.is_static:
            pose = np.broadcast_to(self.poses[-1], (len(times_s), 7))
            return pose[:, :3], pose[:, 3:]
        after = np.clip(np.searchsorted(self.times_s, times_s), 1, max(len(self.times_s) - 1, 1))
        after = np.minimum(after, len(self.times_s) - 1)
        before = np.maximum(after - 1, 0)
        gap = self.times_s[after] - self.times_s[before]
        fraction = np.where(
            gap > 0.0, (times_s - self.times_s[before]) / np.where(gap, gap, 1.0), 0.0
        )
        fraction = fraction[:, None]
        p = (1.0 - fraction) * self.poses[before, :3] + fraction * self.poses[after, :3]
        one, other = self.poses[before, 3:], self.poses[after, 3:]
        same = np.sign((one * other).sum(axis=1, keepdims=True) + 1e-300)
        q = rotations.normalize((1.0 - fraction) * one + fraction * same * other)
        unknown = (times_s < self.times_s[0]) | (times_s > self.times_s[-1])
        return np.where(unknown[:, None], np.nan, p), np.where(unknown[:, None], np.nan, q)


class LoggedTransforms:
    """Looks up transforms between the frames of a log."""

    def __init__(self, messages: Iterable[LoggedMessage]) -> None:
        rows: dict[str, list[tuple[float, ...]]] = {}
        parents: dict[str, tuple[str, bool]] = {}
        for topic, time_ns, message in messages:
            for found in message.transforms:
                p, q = found.transform.translation, found.transform.rotation
                numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
                if not np.isfinite(numbers).all() or not any(numbers[3:]):
                    continue
                child = frame_name(found.child_frame_id)
                time_s = (stamp_of(found) or time_ns) / NS_PER_S
                parents[child] = frame_of(found), topic.endswith("tf_static")
                rows.setdefault(child, []).append((time_s, *numbers))
        self._edges = {child: _edge(*parents[child], rows[child]) for child in parents}

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted({*self._edges, *(edge.parent for edge in self._edges.values())}))

    def lookup(self, parent: str, child: str, times_s: ArrayLike | None = None) -> Transforms:
        """Returns the pose of frame `child` in frame `parent`, interpolated.

        times_s: (n,) s; None: the times of the transforms of the fastest moving frame between both,
        or time 0 if none moves. Raises `VoleryError` for an unknown frame, or if no transforms
        connect both.
        """
        up, down = self._chain(frame_name(child)), self._chain(frame_name(parent))
        common = next((frame for frame in up if frame in down), None)
        if common is None:
            raise VoleryError(
                f"no transforms connect '{parent}' and '{child}': they belong to the trees of "
                f"'{down[-1]}' and '{up[-1]}'"
            )
        up, down = up[: up.index(common)], down[: down.index(common)]
        times = self._times(up + down) if times_s is None else np.atleast_1d(times_s).astype(float)
        child_p, child_q = self._pose(up, times)
        parent_p, parent_q = self._pose(down, times)
        back = rotations.conjugate(parent_q)
        return Transforms(
            times,
            rotations.rotate(back, child_p - parent_p),
            rotations.multiply(back, child_q),
        )

    def _pose(self, chain: list[str], times: Array) -> tuple[Array, Array]:
        """Returns the pose of the first frame of a chain in the parent of its last one."""
        position = np.zeros((len(times), 3))
        attitude = np.tile(rotations.IDENTITY, (len(times), 1))
        for frame in chain:
            p, q = self._edges[frame].at(times)
            position = rotations.rotate(q, position) + p
            attitude = rotations.multiply(q, attitude)
        return position, attitude

    def _chain(self, frame: str) -> list[str]:
        """Returns a frame and its ancestors."""
        if frame not in self.frames:
            raise VoleryError(f"there is no frame '{frame}'; known: {', '.join(self.frames)}")
        chain = [frame]
        while chain[-1] in self._edges and len(chain) < _DEEPEST:
            chain.append(self._edges[chain[-1]].parent)
        return chain

    def _times(self, frames: list[str]) -> Array:
        moving = [e.times_s for f in frames if not (e := self._edges[f]).is_static]
        return max(moving, key=len, default=np.zeros(1))


def _edge(parent: str, is_static: bool, rows: list[tuple[float, ...]]) -> _Edge:
    table = np.array(rows, np.float64)
    _, last = np.unique(table[::-1, 0], return_index=True)  # the newest of equal stamps
    table = table[len(table) - 1 - last]
    poses = np.c_[table[:, 1:4], rotations.normalize(table[:, 4:])]
    return _Edge(parent, table[:, 0], poses, is_static)
