"""Waits when it is called, not when it is imported."""
# limits: cpu_s=0.3 wall_s=0.6

import time


def main():
    print('about to wait')
    time.sleep(1000)
