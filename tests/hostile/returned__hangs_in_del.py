"""Nobody waits for destructors."""
# limits: cpu_s=0.3 wall_s=0.6

class Evil:
    def __del__(self):
        while True:
            pass


x = Evil()
