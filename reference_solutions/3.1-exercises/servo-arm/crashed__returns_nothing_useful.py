# diagnosis: the controller returned a str instead of one control, at t = 0 s (step 1)
def control(model, data, target):
    return 'left'
