# diagnosis: a command of a notebook
import mujoco
%matplotlib inline
def largest_stable_timestep(model, integrator): return None
