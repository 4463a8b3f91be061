# diagnosis: The function writes data.ctrl and returns a value, too
import numpy as np, mujoco, math
n=0
def control(model,data,target):
    q,v,b=data.qpos[0],data.qvel[0],data.qfrc_bias[0]
    global n; n+=1
    data.ctrl[0]=60*(target-q)-12*v+b; return 0.0
