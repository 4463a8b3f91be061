"""Neither may many files be more."""

for n in range(200):
    with open(f"f{n}", "wb") as file:
        file.write(bytes(1 << 20))
