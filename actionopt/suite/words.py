"""What solvers say of their answers, in one vocabulary: solved, unbounded, infeasible, gave up.

Statuses are those of the solvers' own documentation, as CasADi hands them on. Where a status is not
in the table, whether the solver calls it a success decides.
"""

from __future__ import annotations

OUTCOME_WORDS = ("solved", "unbounded", "infeasible", "gave up")

_IPOPT = {
    "Solve_Succeeded": "solved",
    "Solved_To_Acceptable_Level": "solved",
    "Feasible_Point_Found": "solved",
    "Diverging_Iterates": "unbounded",
    "Infeasible_Problem_Detected": "infeasible",
}
_SQP = {"Solve_Succeeded": "solved", "No_Feasible_Initialization": "infeasible"}
TABLE: dict[str, dict[str, str]] = {
    "ipopt": _IPOPT,
    "fatrop": {"0": "solved"},
    "cyipopt": {"0": "solved", "1": "solved", "2": "infeasible", "4": "unbounded", "6": "solved"},
    "nlopt": {"1": "solved", "2": "unbounded", "3": "solved", "4": "solved"},
    "sqpmethod": _SQP,
    "feasiblesqpmethod": _SQP,
    "qrsqp": _SQP,
    # Uno's `optimization_status` and `solution_status`; the interface calls all of them a success.
    "uno": {
        "Converged with feasible KKT point": "solved",
        "Converged with feasible FJ point": "solved",
        "Converged with infeasible stationary point": "infeasible",
        "Terminated with unbounded problem": "unbounded",
    },
    # sleqp calls the last two a success as well.
    "sleqp": {
        "optimal": "solved",
        "feasible": "gave up",
        "infeasible": "infeasible",
        "unbounded": "unbounded",
        "deadpoint": "gave up",
    },
}


def message(solver: str, status: str, success: bool) -> str:
    """Return what the solver of this name says with a status of its own."""
    base = solver.partition(":")[0]
    return TABLE.get(base, {}).get(status, "solved" if success else "gave up")
