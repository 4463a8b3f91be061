# diagnosis: generator already executing
import mujoco


class Impatient:
    """Asks again while the keeper is answering: must fail, not wait for ever."""

    def __iter__(self):
        mujoco.mj_forward(MODEL, mujoco.MjData(MODEL))
        return iter((1, 2))


MODEL = mujoco.MjModel.from_xml_string("<mujoco/>")
error = mujoco.mj_forward.__closure__[0].cell_contents(("forward", Impatient()))
if error:
    raise error


def rk4_step(model, data):
    mujoco.mj_forward(model, data)
