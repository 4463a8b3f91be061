"""The code that runs in the cell, bound but not granted."""

print(open("/cell/inside/guest.py").read())
