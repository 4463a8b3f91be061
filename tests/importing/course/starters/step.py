def rk4_step(model, data):
    pass
