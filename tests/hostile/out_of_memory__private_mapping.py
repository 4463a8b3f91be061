"""mmap, private."""
# limits: memory_mb=256

import mmap

x = [mmap.mmap(-1, 1 << 26, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) for _ in range(100)]
