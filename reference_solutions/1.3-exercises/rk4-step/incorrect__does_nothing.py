# diagnosis: Your step changes nothing in data
def rk4_step(model, data):
    h = model.opt.timestep
    q, v = data.qpos.copy(), data.qvel.copy()
    k1 = (v, data.qacc.copy())
    k2 = (v + h / 2 * k1[1], data.qacc.copy())
    q = q + h * k2[0]
