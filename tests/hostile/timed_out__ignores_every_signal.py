"""SIGKILL cannot be ignored."""
# limits: cpu_s=0.3 wall_s=0.6

import signal

for number in range(1, 65):
    try:
        signal.signal(number, signal.SIG_IGN)
    except (OSError, ValueError):
        pass
while True:
    pass
