"""Shared memory that no limit counts but the address space, in pieces that are small enough for that."""

import mmap

x = []
for _ in range(512):
    x.append(mmap.mmap(-1, 1 << 20))
    x[-1].write(b"x" * (1 << 20))
