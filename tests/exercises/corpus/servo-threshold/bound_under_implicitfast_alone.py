# mistake: Euler and discrete are measured, and implicitfast gets the bound 2*sqrt(I/kp) of the spring alone.
# next: Measure implicitfast too: it treats the damper as part of the step, which raises the limit.
# status: partial
# told: damping raises implicitfast's limit
import mujoco, numpy as np
def unstable(model,integ,h):
    model.opt.integrator=integ; model.opt.timestep=h
    d=mujoco.MjData(model); d.qpos[0]=1.0
    while d.time<3.0:
        mujoco.mj_step(model,d)
        if any(w.number for w in d.warning): return True
    return False
def largest_stable_timestep(m,i):
    I=m.body_mass[1]*m.body_ipos[1,2]**2+m.body_inertia[1,1]
    if i==3: return 2*np.sqrt(I/m.actuator_gainprm[0,0])
    lo,hi=1e-3,5e-2
    if not unstable(m,i,hi): return None
    while hi-lo>5e-4:
        mid=(lo+hi)/2
        if unstable(m,i,mid): hi=mid
        else: lo=mid
    return lo,hi
