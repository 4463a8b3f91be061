"""tempfile, told to go elsewhere."""

import tempfile

tempfile.NamedTemporaryFile(dir="/var/tmp")
