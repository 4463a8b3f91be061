# diagnosis: multiply each error by the control period
def make(model):
    total = 0.0

    def act(t, seen):
        nonlocal total
        error = seen[2] - seen[0]
        total += error
        return 9.81 + 12 * error + 8 * total - 8 * seen[1]

    return act
