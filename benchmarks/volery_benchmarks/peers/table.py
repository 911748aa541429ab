"""Renders the figures of the bench `peers` as a Markdown table: one row per contest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery_benchmarks.peers.catalogue import PEERS, Contest, Peer

_HEAD = """\
| contest | peer | peer's | ours | ours to peer's | peer's real-time factor | ours |
|---|---|---:|---:|---:|---:|---:|
"""


def peers_table(
    figures: Mapping[str, float], versions: Mapping[str, str], peers: Sequence[Peer] = PEERS
) -> str:
    """Returns the table with the measured versions below; "-" where a figure is missing."""
    rows = [_row(figures, peer, contest) for peer in peers for contest in peer.contests]
    lines = [f"- {name}: {text}\n" for name, text in versions.items()]
    return _HEAD + "".join(rows) + ("\n" + "".join(lines) if lines else "")


def _row(figures: Mapping[str, float], peer: Peer, contest: Contest) -> str:
    per_s = f"{contest.unit}_per_s"
    cells = [
        _cell(figures, peer.figure(contest, what))
        for what in (
            per_s,
            f"ours_{per_s}",
            "ratio",
            "real_time_factor",
            "ours_real_time_factor",
        )
    ]
    agreement = figures.get(peer.figure(contest, "agreement"))
    agreeing = "" if agreement is None else f"; {agreement:.3%} of distances agree"
    return f"| {contest}{agreeing} | {peer.name} | {' | '.join(cells)} |\n"


def _cell(figures: Mapping[str, float], name: str) -> str:
    return f"{figures[name]:,.4g}" if name in figures else "-"
