"""A regular expression that never ends."""
# limits: cpu_s=0.3 wall_s=0.6

import re

re.match('(a+)+$', 'a' * 100 + 'b')
