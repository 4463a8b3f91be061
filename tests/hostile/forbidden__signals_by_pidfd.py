"""pidfd_open."""

import os

os.pidfd_open(1)
