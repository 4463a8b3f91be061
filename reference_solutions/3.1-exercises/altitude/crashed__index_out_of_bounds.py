# diagnosis: IndexError
def make(model):
    return lambda t, seen: seen[3]
