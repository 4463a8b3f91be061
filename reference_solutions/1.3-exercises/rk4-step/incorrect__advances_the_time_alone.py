# diagnosis: Your step advances data.time and nothing else
def rk4_step(model, data):
    data.time += model.opt.timestep
