# SPDX-License-Identifier: MIT
"""Everything that touches Rerun: showing a flight, recording it, reading it back and taking its picture.

``rerun`` itself is imported where a sink is opened or a file is read, never when this package is imported, so that a
run that nobody watches doesn't pay for it.
"""

import os

# The library warns on the terminal of every file without an index; it reads this when it is imported.
os.environ.setdefault("RUST_LOG", "warn,re_log_encoding::rrd::file_sink=error")
