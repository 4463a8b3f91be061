# diagnosis: It comes to rest beside the target
def make(model):
    return lambda t, seen: 9.81 + 6 * (seen[2] - seen[0]) - 6 * seen[1]
