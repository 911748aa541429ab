"""A result of the bench `bridge` whose figures are known: L = 2 ms/MB S + 1 ms."""

from __future__ import annotations

from volery_benchmarks.bridge.latency_figures import IMAGE_BYTES, size_figures
from volery_benchmarks.registry import Result

_HEADER_BYTES = 49
_SPREAD_S = (0.0, -0.5e-3, 0.0, 1.5e-3, 0.0)

LATENCIES = [
    (size + _HEADER_BYTES, 1e-3 + 2e-3 * size / 1e6 + spread)
    for size in IMAGE_BYTES
    for spread in _SPREAD_S
]


def result(processor="one"):
    figures = {
        "ros_tcp_alpha_s_per_mb": 0.002,
        "ros_tcp_beta_s": 0.001,
        **size_figures(LATENCIES),
    }
    for end_point, mean in {"round_trip": 2.0, "one_way": 1.0, "stop": 1.5}.items():
        figures[f"latency_{end_point}_10x10_ms"] = mean
        figures[f"latency_{end_point}_10x10_std_ms"] = mean / 4.0
    return Result("bridge", {"processor": processor, "numpy": "2.0"}, figures)
