"""Another owner."""

import os

open("x", "w").close()
os.chown("x", 0, 0)
