"""Its own timers change nothing."""
# limits: cpu_s=0.3 wall_s=0.6

import signal

signal.signal(signal.SIGALRM, lambda *a: None)
signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
while True:
    pass
