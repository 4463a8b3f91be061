"""The stack's mapping, moved and made large: RLIMIT_DATA does not count stacks."""

import ctypes

libc = ctypes.CDLL(None, use_errno=True)
libc.mremap.restype = ctypes.c_void_p
libc.mremap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_int]
end = ctypes.c_void_p.in_dll(libc, "__libc_stack_end").value
bottom = (end & -4096) - (16 << 10)
moved = libc.mremap(bottom, 4096, 480 << 20, 1)
if moved == 2**64 - 1:
    raise OSError(ctypes.get_errno(), "mremap")
while True:
    ctypes.memset(moved, 1, 480 << 20)
