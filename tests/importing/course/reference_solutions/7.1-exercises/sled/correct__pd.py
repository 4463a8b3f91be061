def make(model):
    def act(t, observation):
        place, speed, target = observation
        return 20 * (target - place) - 12 * speed

    return act
