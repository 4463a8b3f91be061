"""Python recursion."""

def f():
    f()


f()
