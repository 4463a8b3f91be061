"""Without the word that it ended."""

import os
import struct


def frame(name, code, shape, payload):
    return (b"A" + bytes([len(name)]) + name + code + bytes([len(shape)])
            + struct.pack(f"<{len(shape)}I", *shape) + struct.pack("<I", len(payload)) + payload)


def end(kind=0, reason=b""):
    return b"E" + struct.pack("<BH", kind, len(reason)) + reason


def send(data):
    os.write(3, data)
    os._exit(0)


send(frame(b"x", b"d", (1,), bytes(8)))
