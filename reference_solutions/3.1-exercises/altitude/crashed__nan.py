# diagnosis: a control that is not finite (nan or inf)
def make(model):
    return lambda t, seen: float('nan') if t > 0.1 else 9.81
