"""Memory of arrays is kept, also where the environment has it given back, as in Dask's workers."""

import os
import platform
import subprocess
import sys

import pytest

COUNTED = """
import resource
import numpy as np
from actionopt.tools.memory import keep_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(100):
        np.ones(2**17)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

given_back = faults()
keep_memory()
faults()
print(given_back, faults())
"""


@pytest.mark.slow
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another library's memory")
def test_a_worker_of_dask_maps_memory_once():
    """A megabyte is 256 pages."""
    environment = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}
    command = [sys.executable, "-c", COUNTED]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60)
    given_back, kept = map(int, done.stdout.split())
    assert given_back > 10_000 and kept < 300


TOGETHER = """
import resource
import numpy as np
import actionopt

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(50):
        [np.ones(2**17) for _ in range(8)]
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

faults()
print(faults())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another library's memory")
def test_eight_megabytes_in_use_together_are_mapped_once():
    """They are 2048 pages, fifty times over where they are given back."""
    environment = {k: x for k, x in os.environ.items() if not k.startswith("MALLOC_")}
    command = [sys.executable, "-c", TOGETHER]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, timeout=60)
    assert int(done.stdout) < 3000
