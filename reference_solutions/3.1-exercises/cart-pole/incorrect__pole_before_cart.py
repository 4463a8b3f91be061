# diagnosis: take pole for cart
def make(model):
    def act(t, observation):
        pole, cart, pole_rate, cart_rate = observation
        return 3 * cart + 60 * pole + 6 * cart_rate + 15 * pole_rate

    return act
