"""The words of the keeper, on every descriptor."""

import os

for descriptor in (1, 2, 3, 4, 5, 6, 7):
    try:
        os.write(descriptor, b'fault grader_fault JailFault')
    except OSError:
        pass
os._exit(1)
