"""C recursion through the interpreter."""
# limits: cpu_s=3

import ctypes

F = ctypes.CFUNCTYPE(None)


@F
def down():
    down()


import sys

sys.setrecursionlimit(10**9)
down()
