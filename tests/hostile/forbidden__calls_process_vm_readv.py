"""process_vm_readv: the process ends with SIGSYS."""

import ctypes

ctypes.CDLL(None).syscall(310, 1, 0, 0, 0, 0, 0)
