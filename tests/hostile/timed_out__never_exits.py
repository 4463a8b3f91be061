"""Finds the frame that would leave, and waits in it."""
# limits: cpu_s=0.3 wall_s=0.6

import time


def main():
    import sys

    frame = sys._getframe()
    while frame:
        if 'leave' in frame.f_locals:
            time.sleep(1000)
        frame = frame.f_back
