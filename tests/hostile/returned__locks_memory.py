"""mlock: swapping is not its business."""

import ctypes

assert ctypes.CDLL(None).mlockall(3) == -1
