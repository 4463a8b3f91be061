"""An array."""
# limits: memory_mb=256

import numpy as np

x = np.ones(10**10)
