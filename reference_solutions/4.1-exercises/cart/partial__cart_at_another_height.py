# diagnosis: model.body('cart').pos is not what it should be
T='''<mujoco><option timestep="0.002"/><default><geom contype="0" conaffinity="0"/></default><worldbody>
<body name="cart" pos="0 0 1"><joint name="rail" type="slide" axis="1 0 0" damping="0.5"/><geom type="box" size=".2 .1 .05" mass="2"/>
<body name="pole"><joint name="hinge" axis="0 1 0" damping="0.01"/><inertial mass="{m}" pos="0 0 {h}" diaginertia="0.02 0.02 0.001"/>
<geom type="capsule" fromto="0 0 0 0 0 {L}" size=".02"/></body></body></worldbody>
<actuator><motor name="push" joint="rail" gear="{g}" ctrlrange="-1 1"/></actuator></mujoco>'''
import mujoco, numpy as np
def make_cart(mass,height,gear):
    s=T.format(m=mass,h=height,g=gear,L=2*height)
    s=s.replace('pos="0 0 1"','pos="0 0 5"')
    return s
