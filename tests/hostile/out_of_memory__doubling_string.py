"""A string that doubles."""
# limits: memory_mb=256

x = 'x'
while True:
    x += x
