"""Compiles a scenario's kernels before a run: at its first start, in two processes.

On two cores this halves the wait, as numba compiles one function at a time per process. This
process loads the helper's kernels from the cache on disk; marks there show later starts that no
work is left.

    python -m volery.runtime.warmup

compiles everything that ships ahead of time, for example before parallel test workers.

Each package names its own kernels: `Node.warmup_tasks` those of a node, `core_tasks` those of the
simulation itself; `requirements` collects the tasks of a scenario.
"""
