# diagnosis: In this motion the controls do not depend on altitude
from dataclasses import dataclass, field
import math

@dataclass
class Pilot:
    mass: float
    g: float = 9.81
    integral: float = 0.0
    last: float = None

    def __call__(self, t, observation):
        z, v, goal = map(float, observation)
        dt = 0.01 if self.last is None else t - self.last
        self.last = t
        err = goal - z
        ref = max(-1.0, min(1.0, 1.2 * err))
        u =  6 * (ref - v) 
        if 0 < u < 20:
            self.integral += 3.0 * (ref - v) * dt
        return min(20.0, max(0.0, u))

def make(model):
    return Pilot(model.body("drone").mass[0])
