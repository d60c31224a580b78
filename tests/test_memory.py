"""Memory of arrays is kept, also where the environment has it given back, as in Dask's workers."""

import os
import platform
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from actionopt.tools import memory
from actionopt.tools.memory import give_back

TOGETHER = """
import resource
import numpy as np
from actionopt import solve

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(50):
        [np.ones(2**17) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
print(faults())
"""


@pytest.mark.long
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another library's memory")
def test_eight_megabytes_in_use_together_are_mapped_once():
    """They are 2048 pages, fifty times over where they are given back."""
    environment = {k: x for k, x in os.environ.items() if not k.startswith("MALLOC_")}
    command = [sys.executable, "-c", TOGETHER]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60)
    assert int(done.stdout) < 3000


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another library's memory")
def test_what_lies_free_among_what_is_used_is_given_back():
    """Of 50 MB in arrays of 100 kB every tenth is held: 45 MB lie free between them."""

    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    arrays = [np.ones(12_500) for _ in range(500)]
    held = arrays[::10]
    del arrays
    before = resident()
    give_back()
    assert before - resident() > 2e7
    assert all(array.all() for array in held)


def test_memory_is_kept_where_glibc_is_told_of_it(monkeypatch):
    told = []
    library = SimpleNamespace(mallopt=lambda *given: told.append(given))
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda name: library)
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "1")
    memory.keep_memory.__wrapped__()
    assert told == [(memory.MAP, memory.LEARNED), (memory.TRIM, 2 * memory.LEARNED)]
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_")
    memory.keep_memory.__wrapped__()
    del library.mallopt
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "1")
    memory.keep_memory.__wrapped__()
    assert len(told) == 2
