"""Catches MemoryError and goes on until it no longer can."""
# limits: memory_mb=256

x = []
for _ in range(3):
    try:
        while True:
            x.append(bytes(1 << 20))
    except MemoryError:
        pass
raise MemoryError
