"""What the searches of a run of members may cost that find no path.

A path that exists is found by a search from nothing as a rule, at several times the price of one
that is reached from a neighbour; where none exists, as past a fold, each search takes all it may.
Costs are second derivatives on one element: the same on any machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from actionopt.solver.search.search import BUDGET

# Budget of searches in vain, whatever was solved. One takes 7,000 to 12,000 with one coordinate,
# hundreds where motions show that none comes to the end, and one that succeeds 1,200 to 2,800 where
# Newton's method from the line does not. Measured on 60 small maps of random systems: with twice as
# much as one way may cost all but 3 of 2276 members are found that `solve` finds; with 3 times as
# much, on 52 of these maps, all are.
FREE_BUDGET = 3 * BUDGET
# Less where few members are left: two searches in vain, and for each what one that succeeds takes.
FEW_LEFT, EACH_LEFT = 12_000, 2_000
# The same where the branch turns back before a member, at a fold: 35 of 39 searches that succeed,
# on ten maps, take less; and for each by which more members are left than are solved.
PAST_FOLD = 9_000
PAST_FOLD_ALONE = 3_000  # with one coordinate, of which searches that succeed take 1,200 to 2,800
BRIEF = 300  # of a search beyond that; descents that succeed take 80 to 170, on five maps


class Exhausted(Exception):
    """What a search may cost is used up; it ends the search."""


class Budget:
    """The cost of paths that were found, and of searches in vain; `limited` or not."""

    def __init__(self, limited: bool, coordinates: int) -> None:
        self.limited, self.found = limited, False  # whether a search found a path
        self.past_fold = PAST_FOLD if coordinates > 1 else PAST_FOLD_ALONE
        self.limit = FREE_BUDGET if limited else math.inf
        self.well, self.vain, self.most = 0.0, 0.0, math.inf

    def count(self, stage: str, done: int, total: int | None, detail: Mapping[str, float]) -> None:
        """Count an iteration of a search: the `progress` of `solve`. It is in vain until found.

        Raises Exhausted where the search costs more than it may.
        """
        self.vain += detail["elements"]
        if self.vain > self.most:
            raise Exhausted

    def begin(self, left: int, solved: int, *, turned: bool) -> None:
        """Limit a search beside known paths, where so many members are left, and solved.

        The first search sets the budget, by the members left; where the branch of a neighbour
        `turned` back, by how many more these are than the others. A search may cost all of it
        until one finds a path; little where nothing is left.
        """
        past_fold = self.limited and turned
        if self.limited and not (self.vain or self.found):
            few, many = (self.past_fold, max(left - solved, 0)) if turned else (FEW_LEFT, left)
            self.limit = min(FREE_BUDGET, few + EACH_LEFT * many)
        if not self.allows:
            self.most = self.vain + BRIEF
        elif self.found:
            self.most = self.vain + FEW_LEFT if past_fold else math.inf
        else:
            self.most = self.limit + self.well

    def note_found(self, before: float) -> None:
        """Take note that a search found a path, before which `vain` was as given."""
        self.well += self.vain - before
        self.vain, self.found = before, True
        if self.limited:
            self.limit = FREE_BUDGET

    @property
    def allows(self) -> bool:
        """Whether a member may be searched for: in vain as much may be spent as on paths."""
        return self.vain < self.limit + self.well
