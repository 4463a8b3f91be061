# mistake: The script reads a model file of the student's own machine while it is imported, which is not there in the grader.
# next: Keep what tries the function under if __name__ == "__main__":.
# status: crashed
# told: ValueError: ParseXML: Error opening file 'kite.xml', in line 6 of your
import mujoco

model = mujoco.MjModel.from_xml_path("kite.xml")
data = mujoco.MjData(model)


def rk4_step(model, data):
    h = model.opt.timestep
    q0, v0, t0 = data.qpos.copy(), data.qvel.copy(), data.time
    vel, acc = [], []
    for c in (0, 0.5, 0.5, 1):
        data.qpos[:] = q0
        if vel:
            mujoco.mj_integratePos(model, data.qpos, vel[-1], c * h)
            data.qvel[:] = v0 + c * h * acc[-1]
        data.time = t0 + c * h
        mujoco.mj_forward(model, data)
        vel.append(data.qvel.copy())
        acc.append(data.qacc.copy())
    data.qpos[:] = q0
    mujoco.mj_integratePos(model, data.qpos, (vel[0] + 2 * vel[1] + 2 * vel[2] + vel[3]) / 6, h)
    data.qvel[:] = v0 + h / 6 * (acc[0] + 2 * acc[1] + 2 * acc[2] + acc[3])
    data.time = t0 + h


for _ in range(1000):
    rk4_step(model, data)
print(data.qpos)
