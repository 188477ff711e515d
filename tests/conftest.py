"""One Hypothesis profile for every property: loops over scans are slow, and slowness is no failure.

In continuous integration (``CI`` set) the examples are the same in every run; elsewhere every run looks at new ones.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

settings.register_profile(
    "pidemu",
    deadline=None,
    max_examples=40,
    print_blob=True,
    derandomize=bool(os.environ.get("CI")),
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
settings.load_profile("pidemu")
