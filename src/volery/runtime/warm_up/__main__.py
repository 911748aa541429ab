"""Compiles all kernels that ship."""

from volery.runtime.warm_up.needs import all_needs
from volery.runtime.warm_up.sharing import compiled

if __name__ == "__main__":
    with compiled(all_needs()):
        pass
