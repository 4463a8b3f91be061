"""Another group."""

import os

os.setgroups([0])
