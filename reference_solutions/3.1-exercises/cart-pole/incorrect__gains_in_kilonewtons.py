# diagnosis: is far too small
def make(model):
    def act(t,o):
        return 0.013*o[0]+0.0675*o[1]+0.0126*o[2]+0.0156*o[3]
    return act
