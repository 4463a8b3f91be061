"""write(2) by hand."""

import os

while True:
    os.write(1, bytes(1 << 16))
