# diagnosis: off by the factor between degrees and radians
def make(model):
    def act(t, observation):
        cart, pole, cart_rate, pole_rate = observation
        return 4 * cart + 60 * pole * 3.14159 / 180 + 6 * cart_rate + 12 * pole_rate * 3.14159 / 180
    return act
