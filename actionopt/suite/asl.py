"""Run a solver that reads AMPL's `.nl` files, and read its `.sol` file.

`BINARY STUB -AMPL` reads STUB.nl and writes STUB.sol. Multipliers there have the sign of df*/dc:
minus those of f + lam'c.

Source: D. M. Gay, *Hooking Your Solver to AMPL*, Bell Laboratories (1997), sections 4 and 5, and
*Writing .nl Files*, Sandia report SAND2005-7907P (2005).
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

from actionopt.tools.immutable import immutable
from actionopt.tools.types import Array

# AMPL's solve_result_num by its hundreds.
SOLVE_RESULTS = ("solved", "solved", "infeasible", "unbounded", "gave up", "gave up")


@immutable
class AmplResult:
    """What a `.sol` file says: x (n,), lam (m,) or None, a message and AMPL's number of the result.

    `lam` are those of f + lam'c.
    """

    x: Array
    lam: Array | None
    message: str
    number: int

    @property
    def meaning(self) -> str:
        """What the number means: "solved", "infeasible", "unbounded" or "gave up"."""
        return SOLVE_RESULTS[min(max(self.number // 100, 0), len(SOLVE_RESULTS) - 1)]


def find(binary: str) -> Path:
    """Return where a solver is: a path, or a name on the search path or beside the interpreter.

    Raises ValueError if there is none that can be executed.
    """
    found = shutil.which(binary) or shutil.which(binary, path=str(Path(sys.executable).parent))
    if found is None:
        raise ValueError(f"expected asl: and a solver that reads .nl files, found no {binary!r}")
    return Path(found).resolve()


def run(binary: Path, stub: Path) -> AmplResult:
    """Return the answer of a solver on STUB.nl.

    Raises RuntimeError if it leaves no STUB.sol that can be read.
    """
    solution = stub.with_suffix(".sol")
    solution.unlink(missing_ok=True)
    done = subprocess.run(
        [str(binary), str(stub), "-AMPL"],
        cwd=stub.parent,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    try:
        return read(solution)
    except (OSError, ValueError, IndexError) as error:
        said = (done.stderr.strip() or done.stdout.strip())[-300:]
        raise RuntimeError(
            f"{binary.name} left no answer, code {done.returncode}: {said}"
        ) from error


def read(file: Path) -> AmplResult:
    """Return what an ASCII `.sol` file says. Raises ValueError or IndexError for another file."""
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    at = lines.index("Options")
    message = " ".join(line.strip() for line in lines[:at] if line.strip())
    at += 2 + int(lines[at + 1])
    _, duals, _, primals = (int(line) for line in lines[at : at + 4])
    numbers = np.array([float(line) for line in lines[at + 4 : at + 4 + duals + primals]])
    if numbers.size != duals + primals:
        raise ValueError(f"expected {duals + primals} values, found {numbers.size}")
    result = lines[at + 4 + duals + primals].split()  # objno 0 CODE
    lam = -numbers[:duals] if duals else None
    return AmplResult(numbers[duals:], lam, message, int(result[2]))
