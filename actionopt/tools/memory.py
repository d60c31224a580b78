"""Arrays of a megabyte, many times a second, without asking the system for their memory each time.

glibc learns from what is freed how much to keep, unless the environment says what it is to keep.
Dask sets MALLOC_TRIM_THRESHOLD_ = 65536 for its workers (and for every process that starts after
them), and each array beyond 128 kB then is new memory: measured, half a million page faults in
three tasks of a sweep, which took as long as all else in them.
"""

from __future__ import annotations

import ctypes
import os
from contextlib import suppress
from functools import cache

TRIM, MAP = -1, -3  # of glibc's <malloc.h>
# Bytes: what glibc learns at most (DEFAULT_MMAP_THRESHOLD_MAX); it keeps twice that when freed.
LEARNED = 2**25


def give_back() -> None:
    """Return to the system what was freed: glibc takes no large array from among small ones."""
    with suppress(AttributeError, OSError, TypeError):  # another library
        ctypes.CDLL(None).malloc_trim(0)


@cache
def keep_memory() -> None:
    """Have memory of arrays kept in this process, as glibc would by itself."""
    if "MALLOC_TRIM_THRESHOLD_" not in os.environ:
        return
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another library
        return
    mallopt(MAP, LEARNED)
    mallopt(TRIM, 2 * LEARNED)
