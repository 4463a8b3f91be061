"""A link for the grader to follow."""

import os

os.symlink("/etc/passwd", "link")
