# diagnosis: The controls are 0 or 1 and nothing between
def make(model):
    def act(t, observation):
        cart, pole, cart_rate, pole_rate = observation
        return 3 * cart + 60 * pole + 6 * cart_rate + 15 * pole_rate > 0

    return act
