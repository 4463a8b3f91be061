# diagnosis: takes mass for height
"""The text with its numbers."""

MODEL = """
<mujoco model="cart">
  <option timestep="0.002"/>
  <worldbody>
    <body name="cart" pos="0 0 1">
      <joint name="rail" type="slide" axis="1 0 0" damping="0.5"/>
      <geom name="cart" type="box" size="0.2 0.1 0.05" mass="2"/>
      <body name="pole">
        <joint name="hinge" axis="0 1 0" damping="0.01"/>
        <inertial mass="{mass}" pos="0 0 {height}" diaginertia="0.02 0.02 0.001"/>
        <geom name="pole" type="capsule" fromto="0 0 0 0 0 0.6" size="0.02" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="push" joint="rail" gear="{gear}" ctrlrange="-1 1"/>
  </actuator>
</mujoco>
"""


def make_cart(height, mass, gear):
    return MODEL.format(mass=mass, height=height, gear=gear)
