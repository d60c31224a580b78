r"""Four equal bodies chasing each other along an eight of two unequal loops.

       .-.
      4   1  .------3
       '---'.'       \
             \        |
              '---2--'

A quarter of the period later each body stands where the next one stood.
"""

from __future__ import annotations

import numpy as np

from actionopt.scenes._choreography import attraction, part
from actionopt.scenes._scene import Setup, Words

TITLE = "four bodies on an uneven eight, a quarter of the way round"
SOURCE = (
    "the choreography super_eight of Shamrock's examples (tdavidcl/Shamrock, "
    "run_sink_integ_test_problems.py); on such paths Simo, New families of solutions in N-body "
    "problems, Progress in Mathematics 201 (2001), p. 101"
)
WORDS = Words(
    question="Four equal bodies are to follow each other along one curve. Is there one?",
    answer="There are many; on this one each stands after a quarter where the next one stood.",
    look="The four trails together are one curve, an eight of two unequal loops.",
    beside=("figure_eight", "three_on_a_circle"),
)

# At unit masses and G, the period 2 pi; S over it.
PLACES = np.array(
    [
        [-0.4038762220290363, 0.1985692946429415],
        [0.7203687816847304, -0.8624679668854116],
        [0.7932678669074159, 0.2521451538161689],
        [-1.10976042656311, 0.411753518426301],
    ]
)
VELOCITIES = np.array(
    [
        [0.3911911293788881, -1.4805596570053108],
        [0.8359875347674515, 0.2867539941403371],
        [-0.8285678288275163, 0.524380416964179],
        [-0.3986108353188244, 0.6694252459007946],
    ]
)
UNEVEN_PERIOD, UNEVEN_ACTION = 2 * np.pi, 44.43788585155287


def lagrangian(q, v, t, *, m, G):
    """L = sum over i of m v_i^2 / 2 + sum over i < j of G m^2 / |r_i - r_j|."""
    return m * np.sum(v**2) / 2 + attraction(q, m, G)


def scene(*, m=1.0, G=1.0, length=1.0) -> Setup:
    """Move four masses m (kg) by a quarter of the period, 2 pi sqrt(length^3 / (G m)).

    The guess is the cubic with the right velocities at both ends. The facts have the `period` (s)
    and `period_action`, S over one.
    """
    return part(PLACES, VELOCITIES, UNEVEN_PERIOD, UNEVEN_ACTION, m, G, length)
