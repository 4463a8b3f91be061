"""The traceback asks the exception what it is."""
# limits: cpu_s=0.3 wall_s=0.6

class Evil(Exception):
    def __str__(self):
        while True:
            pass


raise Evil
