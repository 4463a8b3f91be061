"""mmap, shared: counted by the address space only."""
# limits: memory_mb=256

import mmap

x = [mmap.mmap(-1, 1 << 26) for _ in range(100)]
