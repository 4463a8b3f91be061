# diagnosis: carry gravity has the wrong sign
def make(model):
    s=0.0
    def act(t,o):
        nonlocal s
        e=o[2]-o[0]
        if abs(e)<1: s+=0.01*e
        return -9.81+12*e-8*o[1]+8*s
    return act
