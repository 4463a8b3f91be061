"""The scratch directory is 16 MB, and so is a file."""

with open("big", "wb") as file:
    while True:
        file.write(bytes(1 << 20))
