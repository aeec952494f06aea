"""Settings all tests share: hypothesis tries the same examples on every machine.

The tests run in as many processes as there are cores: threads of BLAS would only compete.
"""

import os

from hypothesis import settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

settings.register_profile("vcam", derandomize=True, database=None, deadline=None)
settings.load_profile("vcam")
