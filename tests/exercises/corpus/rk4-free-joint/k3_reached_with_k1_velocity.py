# mistake: The position of the third stage is moved with the velocity of the first stage, which was left in the copied line.
# next: Move the position of k3 with the velocity of the second stage.
# status: incorrect
# told: In your stage 3, the position uses the first slope again: it moves by h/2 k1, not by h/2
import mujoco
def rk4_step(model, data):
    h=model.opt.timestep
    q=data.qpos.copy(); v=data.qvel.copy(); w=data.act.copy(); t=data.time
    mujoco.mj_forward(model,data)
    v1=v; a1=data.qacc.copy(); w1=data.act_dot.copy()
    q2=q.copy(); mujoco.mj_integratePos(model,q2,v1,h/2)
    v2=v+h/2*a1
    data.qpos[:]=q2; data.qvel[:]=v2; data.act[:]=w+h/2*w1; data.time=t+h/2
    mujoco.mj_forward(model,data)
    a2=data.qacc.copy(); w2=data.act_dot.copy()
    q3=q.copy(); mujoco.mj_integratePos(model,q3,v1,h/2)
    v3=v+h/2*a2
    data.qpos[:]=q3; data.qvel[:]=v3; data.act[:]=w+h/2*w2; data.time=t+h/2
    mujoco.mj_forward(model,data)
    a3=data.qacc.copy(); w3=data.act_dot.copy()
    q4=q.copy(); mujoco.mj_integratePos(model,q4,v3,h)
    v4=v+h*a3
    data.qpos[:]=q4; data.qvel[:]=v4; data.act[:]=w+h*w3; data.time=t+h
    mujoco.mj_forward(model,data)
    a4=data.qacc.copy(); w4=data.act_dot.copy()
    data.qpos[:]=q; mujoco.mj_integratePos(model,data.qpos,(v1+2*v2+2*v3+v4)/6,h)
    data.qvel[:]=v+h/6*(a1+2*a2+2*a3+a4)
    data.act[:]=w+h/6*(w1+2*w2+2*w3+w4)
