"""A deadlock."""
# limits: cpu_s=0.3 wall_s=0.6

import threading

lock = threading.Lock()
lock.acquire()
lock.acquire()
