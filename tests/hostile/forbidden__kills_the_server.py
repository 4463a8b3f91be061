"""By its number."""

import os
import target

os.kill(target.SERVER, 9)
