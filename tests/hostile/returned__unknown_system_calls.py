"""What does not exist yet is answered ENOSYS."""

import ctypes

libc = ctypes.CDLL(None, use_errno=True)
for number in (451, 460, 470, 500, 511, 1000):
    assert libc.syscall(number, 0, 0, 0, 0, 0, 0) == -1, number
    assert ctypes.get_errno() == 38, (number, ctypes.get_errno())
