"""fork()."""

import os

os.fork()
