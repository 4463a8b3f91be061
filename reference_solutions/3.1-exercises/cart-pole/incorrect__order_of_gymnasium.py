# diagnosis: take pole for cart_rate
def make(model):
    def act(t, observation):
        cart, cart_rate, pole, pole_rate = observation
        return 3 * cart + 60 * pole + 6 * cart_rate + 15 * pole_rate

    return act
