import os
import struct


def make(model):
    def act(t, seen):
        os.write(3, b"C" + struct.pack("<I", 4) + b"X[[[")
        return 0.0

    return act
