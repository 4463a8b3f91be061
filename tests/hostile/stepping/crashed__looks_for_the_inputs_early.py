"""The inputs, wanted while the integrators still work: from the caller's frames, and from the job's channel."""

import select
import sys


def found():
    frame = sys._getframe()
    while frame is not None:
        for value in list(frame.f_locals.values()):
            if isinstance(value, dict) and "q" in (value.get("inputs") or value):
                return True
        frame = frame.f_back
    return bool(select.select([4], [], [], 0.5)[0])


def step(model, data):
    pass


if not found():
    raise LookupError("there are no inputs")
