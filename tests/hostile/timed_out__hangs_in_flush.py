"""A stdout of its own that never flushes."""
# limits: cpu_s=0.3 wall_s=0.6

import sys


class Evil:
    def write(self, text):
        pass

    def flush(self):
        while True:
            pass


sys.stdout = Evil()
