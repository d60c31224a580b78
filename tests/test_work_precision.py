"""The benchmark's questions without given times: who answers comes to the closed form."""

from itertools import product

import pytest
from helpers import a_quarter

from benchmarks import floor, peers, worker

NAMES = ("pendulum_energy", "orbit", "kink", "fish_eye")
PEERS = ("actionopt_", "scipy_bvp", "dop853", "ipopt_alone")


@pytest.mark.parametrize(("name", "peer"), a_quarter(product(NAMES, PEERS)))
def test_a_question_is_answered_or_cannot_be_asked(name, peer):
    case = worker._cases()[name]
    start = case.starts[0]
    found = worker.measure(peers.get(peer), name, start, 1e-8, "cold")
    if case.asks in peers.get(peer).answers:
        assert found["status"] == "" and found["error"] < 1e-7
    else:
        assert found["status"].startswith("unable: cannot")
        assert peer == "ipopt_alone" or (peer, name) == ("dop853", "kink")


def test_a_duration_that_is_off_is_an_error():
    case = worker._cases()["pendulum_energy"]
    ends = case.ends()[0]
    found = peers.get("scipy_bvp").cold(case, ends, "line", 1e-8)
    late = 1.01 * found.duration
    assert case.error(found.curve, ends, found.duration) < 1e-7
    assert case.error(lambda t: found.curve(t / 1.01), ends, late) == pytest.approx(0.01, rel=1e-4)


def test_a_cold_solve_takes_longer_than_what_casadi_alone_takes_of_it():
    case = worker._cases()["pendulum"]
    parts, (ours, _), shown = floor.measured(case, 1e-3, 3)
    assert min(parts) > 0 and sum(parts) < ours
    nodes, iterates = map(int, shown.split(" x "))
    assert nodes > 8 and 2 < iterates < 20
