"""At once."""
# limits: memory_mb=256

x = [0] * 10**11
