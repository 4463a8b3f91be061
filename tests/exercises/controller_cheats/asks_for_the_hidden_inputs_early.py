import os


def make(model):
    os.write(3, b"W")
    return lambda t, seen: 0.0
