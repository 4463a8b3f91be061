def make(model):
    total = 0.0

    def act(t, observation):
        nonlocal total
        height, velocity, target = observation
        error = target - height
        thrust = 9.81 + 12 * error + 8 * total - 8 * velocity
        if 0 < thrust < 20 and abs(error) < 1:
            total += 0.01 * error
        return min(max(thrust, 0.0), 20.0)

    return act
