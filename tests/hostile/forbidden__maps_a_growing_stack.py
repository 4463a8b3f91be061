"""A mapping that is called a stack: RLIMIT_DATA does not count it."""

import mmap

MAP_GROWSDOWN = 0x100
x = [mmap.mmap(-1, 1 << 28, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | MAP_GROWSDOWN) for _ in range(3)]
