"""Classes of runs in time, as the points table of a transient study has them."""

from __future__ import annotations

STABLE = "stable"  # decays to steady sliding
LIMIT_CYCLE = "limit_cycle"
IRREGULAR = "irregular"  # lasts, without a level that is steady over ten periods
GROWING = "growing"  # lasts; its level is not reached yet
UNDECIDED = "undecided"  # the run is too short to tell
FAILED = "failed"
LEVELLED = (LIMIT_CYCLE, IRREGULAR)  # those whose level is that of the vibration that lasts
LASTING = (*LEVELLED, GROWING)
