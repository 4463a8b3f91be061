# mistake: h is a 32-bit float.
# next: Take h = model.opt.timestep as it is.
# status: incorrect
# told: of model.opt.timestep: it goes through 32-bit floats
import mujoco, numpy as np
def qmul(a,b):
    w,x,y,z=a; W,X,Y,Z=b
    return np.array([w*W-x*X-y*Y-z*Z, w*X+x*W+y*Z-z*Y, w*Y-x*Z+y*W+z*X, w*Z+x*Y-y*X+z*W])
def blocks(m):
    for j in range(m.njnt):
        yield m.jnt_type[j], m.jnt_qposadr[j], m.jnt_dofadr[j]
def qdot(m,q,v):
    d=np.zeros(m.nq)
    for t,a,b in blocks(m):
        if t==0:
            d[a:a+3]=v[b:b+3]; d[a+3:a+7]=.5*qmul(q[a+3:a+7],np.r_[0,v[b+3:b+6]])
        elif t==1: d[a:a+4]=.5*qmul(q[a:a+4],np.r_[0,v[b:b+3]])
        else: d[a]=v[b]
    return d
def norm(m,q):
    q=q.copy()
    for t,a,b in blocks(m):
        s=slice(a+3,a+7) if t==0 else slice(a,a+4)
        if t<2: q[s]/=np.linalg.norm(q[s])
    return q

class St:
    def __call__(s,m,d):
        h=np.float32(m.opt.timestep); t=d.time; q,v,w=d.qpos.copy(),d.qvel.copy(),d.act.copy()
        V=[];X=[];D=[]
        for c in (0,.5,.5,1):
            qq=q.copy()
            if V: mujoco.mj_integratePos(m,qq,V[-1],c*h)
            d.qpos=qq; d.qvel=v+(c*h*X[-1] if X else 0); d.act=w+(c*h*D[-1] if D else 0); d.time=t+c*h
            mujoco.mj_forward(m,d); V.append(d.qvel.copy()); X.append(d.qacc.copy()); D.append(d.act_dot.copy())
        f=lambda k:(k[0]+2*k[1]+2*k[2]+k[3])/6
        mujoco.mj_integratePos(m,q,f(V),h); d.qpos=q; d.qvel=v+h*f(X); d.act=w+h*f(D); d.time=t+h
rk4_step=St()
