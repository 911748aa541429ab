"""Compiles all kernels that ship."""

from volery.runtime.warmup.parallel_compilation import compile_all
from volery.runtime.warmup.requirements import all_needs

if __name__ == "__main__":
    compile_all(all_needs())
