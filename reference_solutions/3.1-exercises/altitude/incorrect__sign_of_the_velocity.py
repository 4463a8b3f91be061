# diagnosis: The gain on climb has the wrong sign
def make(model):
    return lambda t, seen: 9.81 + 6 * (seen[2] - seen[0]) + 6 * seen[1]
