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


THREADS = """
from volery.core.allocator import return_free_memory, return_large_blocks
return_large_blocks()
import ctypes, re, threading
from pathlib import Path

libc = ctypes.CDLL(None)
libc.malloc.restype = ctypes.c_void_p
BLOCK, COUNT = 60_000, 300

def resident_mb(address):
    for mapping in re.split(r"\\n(?=[0-9a-f]+-)", Path("/proc/self/smaps").read_text()):
        first, last = (int(end, 16) for end in mapping.split()[0].split("-"))
        if first <= address < last:
            return int(re.search(r"Rss: +(\\d+)", mapping)[1]) / 1024

def use():
    blocks = (ctypes.c_void_p * COUNT)()  # a list would grow, and end up behind them
    for k in range(COUNT):
        blocks[k] = libc.malloc(ctypes.c_size_t(BLOCK))
        ctypes.memset(ctypes.c_void_p(blocks[k]), 1, BLOCK)
    for k in range(1, COUNT):
        libc.free(ctypes.c_void_p(blocks[k]))
    before = resident_mb(blocks[0])
    return_free_memory()
    print(before, resident_mb(blocks[0]))

thread = threading.Thread(target=use)
thread.start()
thread.join()
"""


def test_the_end_of_a_threads_heap_is_returned():
    """`malloc_trim` alone leaves it: after a crowd of clients up to 32 MB."""
    found = subprocess.run(
        [sys.executable, "-c", THREADS], capture_output=True, text=True, check=True
    )
    before, after = map(float, found.stdout.split())
    assert before > 15.0
    assert after < 2.0
