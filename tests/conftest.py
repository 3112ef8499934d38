"""Kernels compiled by the tests are kept in a temporary directory, unless PSIM_CACHE_DIR says where.

The directory must be known before any kernel is declared, hence before the package is imported.
"""

import atexit
import os
import shutil
import tempfile

if "PSIM_CACHE_DIR" not in os.environ:
    _directory = tempfile.mkdtemp(prefix="psim-kernels-")
    os.environ["PSIM_CACHE_DIR"] = _directory
    atexit.register(shutil.rmtree, _directory, ignore_errors=True)
