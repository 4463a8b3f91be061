# diagnosis: The integrator winds up
def make(model):
    total = 0.0

    def act(t, seen):
        nonlocal total
        error = seen[2] - seen[0]
        total += 0.01 * error
        return 9.81 + 6 * error + 4 * total - 5 * seen[1]

    return act
