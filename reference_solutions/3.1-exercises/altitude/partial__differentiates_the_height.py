# diagnosis: differentiate a noisy measurement
def make(model):
    total, before = 0.0, None

    def act(t, seen):
        nonlocal total, before
        height, target = seen[0], seen[2]
        before = height if before is None else before
        rate, before = (height - before) / 0.01, height
        error = target - height
        total += 0.01 * error
        return 9.81 + 12 * error + 8 * total - 8 * rate

    return act
