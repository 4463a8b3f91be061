"""Frames and garbage: the driver and the inputs are all there is."""

import gc
import sys

assert not [name for name in sys.modules if name.startswith('grader')]
frame = sys._getframe()
while frame:
    print(frame.f_code.co_name)
    frame = frame.f_back
print(sum(type(thing).__module__.startswith('grader') for thing in gc.get_objects()))
