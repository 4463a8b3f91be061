"""A file of a terabyte that is not there."""

with open("sparse", "wb") as file:
    file.truncate(1 << 40)
