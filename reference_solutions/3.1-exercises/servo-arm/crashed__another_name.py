# diagnosis: Rename controller to control
def controller(model, data, target):
    return 0.0
