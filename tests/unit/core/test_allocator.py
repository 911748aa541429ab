"""Tests that large memory blocks are returned to the system."""

import subprocess
import sys

PROGRAM = """
from volery.core.allocator import return_large_blocks
return_large_blocks()
from pathlib import Path

def resident_mb():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20

before, above = resident_mb(), []
for _ in range(4):  # from the second on, glibc would serve these from its heap
    blocks = []
    for _ in range(8):
        blocks.append(bytearray(10_000_000))
        above.append(bytes(50_000))
    del blocks
print(resident_mb() - before)
"""


def test_large_blocks_are_returned_when_they_are_freed():
    found = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert float(found.stdout) < 10.0
