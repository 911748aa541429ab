"""Compiles all kernels that ship."""

from volery.runtime.warm_up.needs import all_needs
from volery.runtime.warm_up.sharing import compile_all

if __name__ == "__main__":
    compile_all(all_needs())
