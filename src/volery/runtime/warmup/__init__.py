"""What is compiled before a run: a scenario's kernels, at its first start, in two processes.

On two cores the wait is halved: numba compiles one function at a time in a process. What the other
one compiles reaches this process through the cache on disk; marks there tell later starts that
nothing is left to do.

    python -m volery.runtime.warmup

compiles all that ships ahead of time, as before parallel test workers.

Each room knows its own kernels: a node's are named by `Node.warmup_tasks`, those of the simulation
itself by `parts`; `needs` tells which of them a scenario needs.
"""
