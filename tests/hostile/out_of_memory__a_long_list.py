"""Python objects."""
# limits: memory_mb=256

x = []
while True:
    x.append(bytes(1 << 20))
