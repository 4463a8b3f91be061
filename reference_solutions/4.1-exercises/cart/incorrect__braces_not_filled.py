# diagnosis: pos of <inertial> has {height} in place of a number
import xml.etree.ElementTree as ET

def make_cart(mass, height, gear):
    root = ET.Element("mujoco", model="cart")
    ET.SubElement(root, "option", timestep="0.002")
    world = ET.SubElement(root, "worldbody")
    cart = ET.SubElement(world, "body", name="cart", pos="0 0 1")
    ET.SubElement(cart, "joint", name="rail", type="slide", axis="1 0 0", damping="0.5")
    ET.SubElement(cart, "geom", type="box", size="0.2 0.1 0.05", density=str(2 / (0.4 * 0.2 * 0.1)), contype="0", conaffinity="0")
    pole = ET.SubElement(cart, "body", name="pole")
    ET.SubElement(pole, "joint", name="hinge", axis="0 1 0", damping="0.01")
    ET.SubElement(pole, "inertial", pos="0 0 {height}", mass=repr(mass), fullinertia="0.02 0.02 0.001 0 0 0")
    act = ET.SubElement(root, "actuator")
    ET.SubElement(act, "motor", name="push", joint="rail", gear=f"{gear}", ctrlrange="-1 1")
    return ET.tostring(root, encoding="unicode")
