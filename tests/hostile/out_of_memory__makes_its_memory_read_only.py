"""Memory that is made read-only once it is filled: RLIMIT_DATA counts only what can be written."""

import ctypes
import mmap

libc, kept = ctypes.CDLL(None, use_errno=True), []
for _ in range(7):
    kept.append(mmap.mmap(-1, 1 << 26, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS))
    address = ctypes.addressof(ctypes.c_char.from_buffer(kept[-1]))
    ctypes.memset(address, 1, 1 << 26)
    if libc.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(1 << 26), mmap.PROT_READ):
        raise OSError(ctypes.get_errno(), "mprotect")
while True:
    pass
