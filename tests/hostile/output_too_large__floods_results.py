"""More on the results channel than fits."""

import os

while True:
    os.write(3, bytes(1 << 16))
