"""C recursion in the interpreter: an iterator over iterators over iterators."""
# limits: cpu_s=3

deep = iter([1])
for _ in range(300_000):
    deep = map(int, deep)
next(deep)
