"""What is freed goes back to the machine."""

from __future__ import annotations

import os
import subprocess
import sys

KEPT = """
import os, re
from services.memory import few_arenas, give_back

def held():
    return int(re.search(r"VmRSS:\\s+(\\d+)", open("/proc/self/status").read())[1]) // 1024

few_arenas()
much = [bytes(50_000) for _ in range(2000)]  # below what malloc maps by itself
much, last = None, much[-1]  # the last one stays, so that nothing above the rest is free by itself
before = held()
give_back()
print(os.environ["MALLOC_ARENA_MAX"], before - held())
"""


def test_after_something_that_needed_much_memory_it_is_given_back() -> None:
    environment = {name: value for name, value in os.environ.items() if name != "MALLOC_ARENA_MAX"}
    done = subprocess.run([sys.executable, "-c", KEPT], capture_output=True, text=True, check=True, env=environment)
    arenas, freed_mb = done.stdout.split()
    assert arenas == "2"
    assert int(freed_mb) > 80
