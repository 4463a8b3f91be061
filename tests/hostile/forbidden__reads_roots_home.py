"""The administrator's files."""

import os

print(os.listdir("/root"))
