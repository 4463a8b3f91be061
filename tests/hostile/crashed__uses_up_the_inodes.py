"""A million empty files."""

for n in range(1_000_000):
    open(f"f{n}", "w").close()
