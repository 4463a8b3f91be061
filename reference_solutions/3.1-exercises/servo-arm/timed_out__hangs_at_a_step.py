# diagnosis: step 251 at t = 1 s
def control(model, data, target):
    while data.time > 1 - 1e-9:
        pass
    return 0.1
