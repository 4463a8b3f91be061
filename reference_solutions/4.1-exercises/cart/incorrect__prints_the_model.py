# diagnosis: The function returns nothing
def make_cart(mass, height, gear):
    print("<mujoco/>")
