"""Mode bits."""

import os

open("sh", "w").close()
os.chmod("sh", 0o4755)
