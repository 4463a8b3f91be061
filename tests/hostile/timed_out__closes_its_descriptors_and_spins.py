"""No pipe left to notice its death by."""
# limits: cpu_s=0.3 wall_s=0.6

import os

os.closerange(0, 64)
while True:
    pass
