# diagnosis: nan in data.qpos
import mujoco
def largest_stable_timestep(model, integrator):
    model.opt.integrator=integrator
    for k in range(98,0,-1):
        model.opt.timestep=k*5e-4
        d=mujoco.MjData(model)
        d.qpos = None
        bad=False
        while d.time<3 and not bad:
            mujoco.mj_step(model,d)
            bad = d.warning[3].number>0
        if not bad: return k*5e-4,(k+1)*5e-4
    return None
