class Odd(Exception):
    def __str__(self):
        raise ValueError


def make(model):
    def act(t, seen):
        raise Odd

    return act
