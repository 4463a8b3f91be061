"""Where Python cannot interrupt it."""
# limits: cpu_s=0.3 wall_s=0.6

x = sum(range(10**12))
