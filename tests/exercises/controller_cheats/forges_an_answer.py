import os
import struct


def make(model):
    def act(t, seen):
        os.write(3, b"C" + struct.pack("<I", 9) + b"C" + struct.pack("<d", 9.81))
        return 0.0

    return act
