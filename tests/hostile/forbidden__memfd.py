"""A file without a file system."""

import os

os.memfd_create("x")
