"""The same on the other."""

import sys

while True:
    sys.stderr.write('x' * 1000)
