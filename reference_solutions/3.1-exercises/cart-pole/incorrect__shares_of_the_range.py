# diagnosis: as shares of what the actuator gives
def make(model):
    def act(t, observation):
        cart, pole, cart_rate, pole_rate = observation
        return (4 * cart + 60 * pole + 6 * cart_rate + 12 * pole_rate) / 20
    return act
