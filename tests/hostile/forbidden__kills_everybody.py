"""kill(-1, SIGKILL)."""

import os

os.kill(-1, 9)
