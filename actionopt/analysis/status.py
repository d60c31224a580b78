"""What came of a solve, in whole sentences."""

from __future__ import annotations

from enum import Enum


class Status(Enum):
    """The verdict on a solution; the value is the sentence a user reads."""

    SOLVED = "the path is stationary and its error estimate meets the tolerance"
    ON_MESH = (
        "the path is stationary on the mesh that was given; its error is estimated, not controlled"
    )
    FLOOR = (
        "the path is stationary, but round-off, amplified by the problem's own sensitivity to its "
        "end points, or a force that jumps on the way, as dry friction does, forbids the "
        "tolerance: the error estimate says what was reached; loosen tol"
    )
    DEGENERATE = (
        "the end event is (numerically) conjugate to the start event, or the path is one of a "
        "family of closed paths: it is not determined by its events, and no number that differs "
        "within the family can be trusted; move an end point or the end time"
    )
    DWELLING = (
        "both events are equilibria, at which the motion dwells for most of the time: when it "
        "passes from one to the other is hardly determined, or not at all, and so is no number "
        "here but the action; put the events at infinite times, Event(-math.inf, q) and "
        "Event(math.inf, q), which chooses an origin of time"
    )
    UNRESOLVED = (
        "the path found on a coarse mesh did not settle under refinement: (a) the motion has a "
        "collision or a singularity, (b) the first path was an artefact of the coarse mesh, or "
        "(c) the guess was too far; try a guess nearer the motion, or a Mesh of your own"
    )
    UNBOUNDED = (
        "the action is unbounded below, as it is past a conjugate point: there is no least path, "
        "though there may be a stationary one; try principle='stationary' or 'auto'"
    )
    NOT_LEAST = (
        "the path is stationary but not least: the second variation is negative on some "
        "variation, as past a conjugate point; try another guess, or, without an obstacle, "
        "principle='stationary' or 'auto'"
    )
    JUMP = (
        "the Lagrangian jumps on a surface that the path crosses, and the energy with it: the "
        "force there is infinite, no derivative shows it, and this is no stationary path; replace "
        "the step (a comparison, abs(q) / q, the branch of an arctan) by a smooth one "
        "(np.tanh) of some width, or give one system for each side and the surface between them: "
        "Problem([one, other], start, end, through=[Event(None, None, on=surface)])"
    )
    OUT_OF_TIME = (
        "the time that was given ran out: this is the best attempt so far, which may be no path; "
        "give more seconds, a guess, a shorter duration or a larger tol"
    )
    NOT_FOUND = (
        "no stationary path was found: (a) there may be none between these events, (b) the "
        "straight line between them, or the guess, is too far from one, or (c) the Lagrangian is "
        "not smooth or not finite on the way; try another guess, a shorter duration, "
        "or `trace` from a problem nearby that is solved"
    )

    def __str__(self) -> str:
        """Return the sentence."""
        return self.value

    @property
    def success(self) -> bool:
        """Whether the path can be used as it is."""
        return self in (Status.SOLVED, Status.ON_MESH)

    @property
    def stationary(self) -> bool:
        """Whether the path is a stationary one, known as well as it can be."""
        return self.success or self is Status.FLOOR
