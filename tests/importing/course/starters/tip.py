def tip(angle):
    return 0.0
