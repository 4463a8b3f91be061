"""Nothing of it is left on the disk."""

import resource

assert resource.getrlimit(resource.RLIMIT_CORE) == (0, 0)
