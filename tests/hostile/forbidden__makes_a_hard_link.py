"""A second name for a file of ours."""

import os
import numpy

os.link(numpy.__file__, "link")
