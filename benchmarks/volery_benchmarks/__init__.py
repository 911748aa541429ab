"""Benchmarks: modules with `measure() -> dict[str, float]`, run by `volery bench NAME`."""
