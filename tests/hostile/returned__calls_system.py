"""system(3) cannot fork."""

import os

assert os.system("id > out") != 0
assert not os.path.exists("out")
