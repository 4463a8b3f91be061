"""It is alone in its pid namespace."""

import os

assert os.getpid() == 1 and os.getppid() == 0
for pid in range(2, 1000):
    assert not os.path.exists(f'/proc/{pid}')
