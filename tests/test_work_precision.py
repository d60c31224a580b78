"""The benchmark's questions without given times: who answers comes to the closed form."""

import pytest
from helpers import a_quarter

from benchmarks import beside, floor, peers, worker

NAMES = ("pendulum_energy", "orbit", "kink", "fish_eye")
PEERS = ("actionopt_", "scipy_bvp", "dop853", "ipopt_alone")
ASKED = [(name, PEERS[k - j]) for j, name in enumerate(NAMES) for k in range(4)]


@pytest.mark.quick("orbit-ipopt_alone", "kink-dop853")
@pytest.mark.parametrize(("name", "peer"), a_quarter(ASKED))
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


@pytest.mark.long
def test_a_cold_solve_takes_longer_than_what_casadi_alone_takes_of_it():
    case = worker._cases()["pendulum"]
    parts, (ours, _), shown = floor.measured(case, 1e-3, 3)
    assert min(parts) > 0 and sum(parts) < ours
    nodes, iterates = map(int, shown.split(" x "))
    assert nodes > 8 and 2 < iterates < 20


def test_the_page_of_what_stands_beside_a_solve_says_what_failed_and_gives_powers():
    family = "masses of a lattice"
    rows = {
        ("analysis", family, "index", n): {
            "solve": 0.002,
            "time": 0.001 * n**2,
            "ratio": n**2 / 2,
            "memory": 1e6 * n,
            "status": "",
        }
        for n in (10, 40, 160)
    }
    page = beside.page({**rows, ("kind", "free end", 2, 1e-6): {"status": "no answer in 60 s"}})
    assert f"| {family} | index | 40 | 2 | 1.6e+03 | 800 | 40 |" in page
    assert f"| {family} | index | 2.0 | 1.0 |" in page
    assert "| free end | 2 | 1e-06 | no answer in 60 s |" in page
