# diagnosis: ZeroDivisionError: float division by zero, in line 4 of your script, at t = 0.4 s (step 101)
def control(model, data, target):
    if data.time >= 0.4 - 1e-9:
        return 1.0 / 0.0
    return 0.1
