"""Pages of a file in scratch."""

import mmap

with open("m", "w+b") as file:
    file.truncate(1 << 30)
    mmap.mmap(file.fileno(), 1 << 30)
