"""A pipe that somebody might open."""

import os

os.mkfifo("pipe")
