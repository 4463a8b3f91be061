"""A disk of its own."""

import os
import stat

os.mknod("disk", 0o666 | stat.S_IFBLK, os.makedev(8, 0))
