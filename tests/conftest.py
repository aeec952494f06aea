"""Settings all tests share: hypothesis tries the same examples on every machine."""

from hypothesis import settings

settings.register_profile("vcam", derandomize=True, database=None, deadline=None)
settings.load_profile("vcam")
