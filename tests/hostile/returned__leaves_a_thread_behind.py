"""A thread that spins when the run is over."""

import threading


def spin():
    while True:
        pass


threading.Thread(target=spin, daemon=True).start()
threading.Thread(target=spin).start()
