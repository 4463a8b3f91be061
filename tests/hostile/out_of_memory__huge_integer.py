"""A number with a billion digits."""
# limits: memory_mb=256

x = 1 << (1 << 33)
