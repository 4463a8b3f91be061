"""Its own last words."""

import sys

sys.excepthook = lambda *a: None
raise RuntimeError('mine')
