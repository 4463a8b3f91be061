"""fallocate(2)."""

import os

with open("x", "wb") as file:
    os.posix_fallocate(file.fileno(), 0, 1 << 20)
