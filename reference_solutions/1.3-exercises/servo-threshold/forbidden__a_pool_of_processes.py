# diagnosis: one is enough
import mujoco
from multiprocessing import Pool
def f(x): return x
def largest_stable_timestep(model, integrator):
    with Pool(2) as p: return p.map(f,[1,2])
