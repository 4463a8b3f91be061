"""setuid(0)."""

import os

os.setuid(0)
