"""tgkill reaches its own process only."""

import ctypes
import target

libc = ctypes.CDLL(None)
assert libc.syscall(234, target.SERVER, target.SERVER, 9) == -1
assert libc.syscall(234, 2, 2, 9) == -1
