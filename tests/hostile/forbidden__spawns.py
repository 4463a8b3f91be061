"""posix_spawn."""

import os

os.posix_spawn("/bin/true", ["true"], {})
