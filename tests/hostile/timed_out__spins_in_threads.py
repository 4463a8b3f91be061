"""On every core."""
# limits: cpu_s=0.3 wall_s=0.6

import threading


def spin():
    while True:
        pass


for _ in range(8):
    threading.Thread(target=spin).start()
spin()
