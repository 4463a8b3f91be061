def make(model):
    return lambda t, seen: 9e307 * (1 if t % 0.04 < 0.02 else -1)
