"""What is in the cell."""

import os

print(os.listdir("/"))
