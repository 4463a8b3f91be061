"""abort(3)."""

import os

os.abort()
