"""An endless loop."""
# limits: cpu_s=0.3 wall_s=0.6

while True:
    pass
