"""Solutions in files come back as they were, and nothing else is taken for one."""

import io
import json
import pickle
import zipfile
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
import systems

import actionopt as ao
from actionopt import Event, Periodic, Problem, System, scenes
from actionopt.analysis.status import Status


def swing(q, v, t, *, l, g):
    return (l * v[0]) ** 2 / 2 + g * l * np.cos(q[0])


SYSTEM = System(swing, ["theta"], parameters={"l": 1.0, "g": 9.81}, name="my own")


@pytest.fixture(scope="module")
def own():
    problem = Problem(SYSTEM, Event(0.0, 0.3), Event(1.0, -0.2), parameters={"l": 0.7})
    return ao.solve(problem, tol=1e-9)


@pytest.fixture(scope="module", params=["rod_pendulum", "kepler", "damped_oscillator"])
def of_a_scene(request):
    return ao.solve(scenes.get(request.param).problem, tol=1e-9)


def assert_same(a, b):
    """Every number of two solutions is the same to the last bit."""
    assert np.array_equal(a.path.values, b.path.values)
    assert np.array_equal(a.mesh.boundaries, b.mesh.boundaries) and a.mesh.degrees == b.mesh.degrees
    assert np.array_equal(a.lam, b.lam, equal_nan=True)
    assert (a.action, a.error, a.status) == (b.action, b.error, b.status)
    assert json.loads(json.dumps(a.stats)) == json.loads(json.dumps(b.stats))
    for role in ("start", "end"):
        mine, other = getattr(a.problem, role), getattr(b.problem, role)
        assert (mine.t, mine.q) == (other.t, other.q)
    assert {k: v.tolist() for k, v in a.problem.parameters.items()} == {
        k: v.tolist() for k, v in b.problem.parameters.items()
    }
    for role in ("start", "end"):
        mine, other = getattr(a, role), getattr(b, role)
        assert mine.t == other.t and np.array_equal(mine.q, other.q)
    t = np.linspace(a.problem.start.t, a.problem.end.t, 17)
    assert np.array_equal(a(t), b(t)) and np.array_equal(a.velocity(t), b.velocity(t))


def assert_same_physics(a, b):
    t = np.linspace(a.problem.start.t, a.problem.end.t, 17)
    for name in ("momentum", "energy", "acceleration", "multipliers", "constraint_force"):
        assert np.array_equal(getattr(a, name)(t), getattr(b, name)(t))
    for x, y in (
        (a.start.v, b.start.v),
        (a.end.v, b.end.v),
        *zip(a.momenta, b.momenta, strict=True),
    ):
        assert x == pytest.approx(y, rel=1e-12)
    if not a.problem.system.structure.forced:
        assert a.morse_index == b.morse_index


def saved(solution, file, **changes):
    """Save a solution, with functions of arrays, or of entries of the text, in their place."""
    solution.save(file)
    if changes:
        with np.load(file) as arrays:
            data = dict(arrays)
        about = json.loads(str(data["about"]))
        for name, change in changes.items():
            holder = data if name in data else about
            holder[name] = change(holder[name])
        np.savez(file, **{**data, "about": np.array(json.dumps(about))})
    return file


# -- there and back -------------------------------------------------------------------------------


@pytest.mark.long
def test_a_scene_comes_back_whole(of_a_scene, tmp_path):
    file = saved(of_a_scene, tmp_path / "solution.npz")
    for system in (None, of_a_scene.problem.system.name, of_a_scene.problem.system):
        loaded = ao.load(file, system)
        assert_same(loaded, of_a_scene)
        assert_same_physics(loaded, of_a_scene)


@pytest.mark.long
def test_a_system_of_ones_own_is_supplied_again(own, tmp_path):
    file = tmp_path / "own.npz"
    own.save(str(file))
    loaded = ao.load(str(file), SYSTEM)
    assert_same(loaded, own)
    assert_same_physics(loaded, own)
    again = System(
        swing, ["theta"], parameters={"l": 3.0, "g": 1.0}
    )  # other defaults, same physics
    assert_same_physics(ao.load(file, again), own)


@pytest.mark.parametrize("start, duration", [(0.2, 2.0), (1e9, 1e-3)])
def test_times_come_back_as_fine_as_they_were(start, duration, tmp_path):
    """Measured from a start far from zero, times are finer than floats there."""
    problem = Problem(SYSTEM, Event(start, 0.3), Event(start + duration, -0.2))
    found = ao.solve(problem, tol=1e-9)
    found.save(tmp_path / "a.npz")
    again = ao.load(tmp_path / "a.npz", SYSTEM)
    assert np.array_equal(found.mesh.since, again.mesh.since)
    assert_same(found, again)
    assert_same_physics(found, again)


def test_files_without_times_from_the_start_are_older(own, tmp_path):
    own.save(tmp_path / "new.npz")
    with np.load(tmp_path / "new.npz") as new:
        np.savez(tmp_path / "old.npz", **{k: new[k] for k in new.files if k != "since"})
    assert_same(own, ao.load(tmp_path / "old.npz", SYSTEM))


def test_without_its_system_there_is_the_path_and_no_physics(own, tmp_path):
    own.save(tmp_path / "own.npz")
    loaded = ao.load(tmp_path / "own.npz")
    assert_same(loaded, own)
    assert loaded.success and loaded.problem.duration == 1.0
    for quantity in (loaded.momentum, loaded.energy, loaded.acceleration):
        with pytest.raises(ValueError, match=r"without its system.*load\(file, system=.*theta"):
            quantity(0.5)
    copied = deepcopy(loaded)
    assert_same(copied, own)
    assert np.array_equal(copied.momenta, own.momenta) and copied.start.v == own.start.v


@pytest.fixture(scope="module")
def closed():
    system = System(lambda q, v, t: v[0] ** 2 / 2 - q[0] ** 2 + q[0] * np.cos(t), ["x"])
    return ao.solve(Problem(system, Event(0.0, [None]), Periodic(2 * np.pi, advance=[0.0])))


def test_a_closed_path_stays_closed_without_its_system(closed, tmp_path):
    closed.save(tmp_path / "closed.npz")
    for system in (None, closed.problem.system):
        loaded = ao.load(tmp_path / "closed.npz", system)
        assert_same(loaded, closed)
        assert isinstance(loaded.problem.end, Periodic)
        assert loaded.problem.end.advance == (0.0,) and loaded.problem.advance.tolist() == [0.0]
    assert loaded.energy(0.5) == pytest.approx(closed.energy(0.5), rel=1e-14)


def turned(by):
    def change(a):
        a[0, -1] += by
        return a

    return {"values": change}


@pytest.mark.parametrize("change", [turned(1e-6), turned(-1e-6), {"advance": lambda a: [0.25]}])
def test_a_closed_path_that_does_not_close_is_refused(closed, change, tmp_path):
    saved(closed, tmp_path / "closed.npz", **change)
    for given in (None, closed.problem.system):
        with pytest.raises(ValueError, match="closes with the advance"):
            ao.load(tmp_path / "closed.npz", given)


def test_a_failed_attempt_can_be_kept(tmp_path):
    problem = scenes.get("oscillator", duration=4.0).problem
    attempt = ao.solve(problem, principle="least", throw=False)
    attempt.save(tmp_path / "failed.npz")
    loaded = ao.load(tmp_path / "failed.npz")
    assert loaded.status is Status.UNBOUNDED and not loaded.success
    assert_same(loaded, attempt)


def test_free_ends_and_arrays_of_parameters_come_back(tmp_path):
    def lattice(q, v, t, *, m, k):
        kinetic = sum(m[i] * v[i] ** 2 for i in range(2)) / 2
        return kinetic - sum(k[i, j] * q[i] * q[j] for i in range(2) for j in range(2)) / 2

    values = {"m": [1.0, 2.0], "k": [[2.0, -1.0], [-1.0, 3.0]]}
    system = System(lattice, ["x", "y"], parameters=values)
    solution = ao.solve(Problem(system, Event(0, [1.0, None]), Event(1, [None, 0.5])))
    solution.save(tmp_path / "lattice.npz")
    loaded = ao.load(tmp_path / "lattice.npz", system)
    assert loaded.problem.start.q == (1.0, None) and loaded.problem.end.q == (None, 0.5)
    assert_same(loaded, solution)
    assert_same_physics(loaded, solution)


def _through():
    """A ball off a moving floor of given slope, a time to be found; and refraction."""
    ball = systems.thrown(g=1.0)
    floor = ao.Bounce(lambda q, t, *, slope: q[1] - slope * q[0] - 0.1 * t)
    ends = Event(0, [0, 1]), Event(2, [1, 0.7])
    yield Problem(ball, *ends, through=[floor], parameters={"slope": 0.1}), ball
    media: Any = [System(lambda q, v, t, n=n: n**2 * (v @ v) / 2, ["x", "y"]) for n in (1.0, 1.5)]
    step = Event(None, None, on=lambda q, t: q[1])
    yield Problem(media, Event(0, [0, 1]), Event(1, [2, -1]), through=[step]), media
    yield Problem(ball, *ends, through=[Event(0.5, [0.1, None]), Event(1, [0.4, 0.2])]), ball

    def ds(q, v, t):
        return np.sqrt(1 + v[0] ** 2)

    rope = System(lambda q, v, t: q[0] * ds(q, v, t), ["y"], integral=ds)
    yield Problem(rope, Event(0, [0]), Event(2, [0.4]), integral=2.6), rope


@pytest.mark.quick("problem0-system0")
@pytest.mark.parametrize(("problem", "system"), [*_through()])
def test_events_between_the_ends_and_integrals_come_back(problem, system, tmp_path):
    file, solution = tmp_path / "through.npz", ao.solve(problem)
    solution.save(file)
    alone = ao.load(file)
    assert_same(alone, solution)
    assert len(alone.legs) == len(problem.through) + 1
    alone.save(file)
    loaded = ao.load(file, system)
    assert_same(loaded, solution)
    assert_same_physics(loaded, solution)
    assert loaded.impulses == pytest.approx(solution.impulses, abs=1e-12)
    assert loaded.integral_multipliers.tolist() == solution.integral_multipliers.tolist()
    for mine, other in zip(loaded.problem.joints, solution.problem.joints, strict=True):
        assert (type(mine), mine.t, mine.q) == (type(other), other.t, other.q)
    again = ao.solve(loaded.problem.replace(), guess=loaded)
    assert again.action == pytest.approx(solution.action, abs=1e-9)
    with np.load(file) as arrays:
        data = dict(arrays)
    data["values"][:, solution.mesh.offsets[solution.mesh.elements // 2]] += 1e-3
    np.savez(file, **data)
    with pytest.raises(ValueError, match=r"damaged|the system of the file, whose action"):
        ao.load(file, system)


SPLINE = System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"])
BEAM = System(
    lambda q, v, a, t, *, P: a[0] ** 2 / 2 - P * v[0] ** 2 / 2 + q[0], ["x"], parameters={"P": 2.0}
)


def _higher():
    """Paths of which values at the nodes tell too little: with accelerations, jerk and snap."""
    leave, arrive = Event(0, [0.0], v=[0.0]), Event(1, [1.0], v=[None])
    yield Problem(SPLINE, leave, arrive, through=[Event(0.4, [0.7], v=[1.5])]), SPLINE
    beam = Problem(BEAM, leave, Event(None, [1.0], v=[0.3]), energy=2.0, parameters={"P": 1.0})
    yield beam, BEAM
    laws: Any = [SPLINE, System(lambda q, v, a, t: a[0] ** 2, ["x"])]
    yield Problem(laws, leave, arrive, through=[Event(0.4, None)]), laws
    snap = System(lambda q, v, a, j, s, t: s @ s / 2 + q @ q, ["x", "y"])
    ends = Event(0.3, [0, 1], v=[1, 0], a=[0, 0], j=[0, 0]), Event(1, [1, 0], a=[None, 2])
    yield Problem(snap, *ends), snap
    line = lambda q, t: q[0] - q[1] - 1  # noqa: E731
    plane = System(lambda q, v, a, t: a @ a / 2 + q[1], ["x", "y"])
    start = Event(0, [0, 0], v=[1, 0])
    yield Problem(plane, start, Event(1, None, on=line, v=[None, 0.5])), plane
    ring = System(lambda q, v, a, t: a[0] ** 2 / 2 + q[0] ** 2 - q[0] * np.cos(t), ["x"])
    yield Problem(ring, Event(0, [None]), Periodic(2 * np.pi)), ring
    held = System(
        lambda q, v, a, t: a @ a / 2 + q[1], ["x", "y"], constraint=lambda q, t: (q @ q - 1) / 2
    )
    on_ring = [Event(s, [np.cos(s), np.sin(s)], v=[-np.sin(s), np.cos(s)]) for s in (0.0, 1.0)]
    yield Problem(held, *on_ring), held

    def height(q, v, t):
        return q[0]

    bent = System(lambda q, v, a, t: a[0] ** 2 / 2, ["x"], integral=height)
    yield Problem(bent, leave, arrive, integral=0.2), bent


@pytest.mark.quick("problem6-system6")
@pytest.mark.parametrize(("problem", "system"), [*_higher()])
def test_accelerations_come_back(problem, system, tmp_path):
    file, solution = tmp_path / "higher.npz", ao.solve(problem)
    solution.save(file)
    alone = ao.load(file)
    assert_same(alone, solution)
    assert np.array_equal(alone.momenta, solution.momenta)
    alone.save(file)
    loaded = ao.load(file, system)
    assert_same(loaded, solution)
    for mine, other in zip(loaded.problem.joints, solution.problem.joints, strict=True):
        assert (type(mine), mine.t, mine.q, mine.rates) == (
            type(other), other.t, other.q, other.rates,
        )  # fmt: skip
    t = np.linspace(solution.problem.start.t, solution.problem.end.t, 7)
    for name in ("momentum", "energy", "derivatives", "multipliers"):
        if name != "multipliers" or problem.system.m:
            assert np.array_equal(getattr(loaded, name)(t), getattr(solution, name)(t))
    assert loaded.morse_index == solution.morse_index
    assert np.array_equal(loaded.impulses, solution.impulses)
    loaded.save(file)
    assert_same(ao.load(file, system), solution)


HIGHER = {
    "another velocity": (
        "rates",
        lambda a: a + 1e-6,
        "damaged .*through its events, found the velocity of",
    ),
    "other velocities inside": (
        "rates",
        lambda a: a * np.r_[1, [1.001] * (a.size - 2), 1],
        "the velocities",
    ),
    "too few velocities": ("rates", lambda a: a[:, 1:], "damaged .*velocities of shape"),
    "velocities of two": ("rates", lambda a: np.vstack([a, a]), "damaged .*belong together"),
    "fewer unknowns": ("unknowns", lambda a: a[1:], "a system of .* unknowns"),
    "other unknowns": ("unknowns", lambda a: a * (1 + 1e-6), "damaged .*the values of the path"),
    "unknowns NaN": ("unknowns", lambda a: a + np.nan, "damaged .*finite unknowns"),
    "another rate": (
        "units",
        lambda a: {**a, "rate": 1.001 * a["rate"]},
        "whose action on its path",
    ),
    "no rate": ("units", lambda a: {**a, "rate": 0.0}, "damaged .*units that are positive"),
    "units of two": ("units", lambda a: {**a, "lengths": [1.0, 1.0]}, "damaged .*belong together"),
    "rows of a constraint": ("units", lambda a: {**a, "row_units": [1.0]}, "in units of shapes"),
    "another velocity given": (
        "events",
        lambda a: [[0.0, [0.0], [0.5]], a[1]],
        "its events, found the velocity",
    ),
    "momenta of the first order": ("momenta", lambda a: a[:, :1], "damaged .*belong together"),
    "momenta of a higher order": ("momenta", lambda a: np.hstack([a, a]), "a system of order 4"),
    "other momenta": (
        "momenta",
        lambda a: a * [1, 1 + 1e-5],
        "damaged .*the momenta of the system",
    ),
}


@pytest.fixture(scope="module")
def beam():
    problem = Problem(BEAM, Event(0, [0.0], v=[0.0]), Event(1, [1.0]))
    return ao.solve(problem, tol=1e-9)


@pytest.mark.parametrize("what", HIGHER)
def test_accelerations_that_do_not_fit_are_refused(beam, what, tmp_path):
    name, change, why = HIGHER[what]
    file = saved(beam, tmp_path / "wrong.npz", **{name: change})
    with pytest.raises(ValueError, match=rf"expected .*{why}"):
        ao.load(file, BEAM)


def test_a_system_of_another_order_is_refused(own, tmp_path):
    higher = System(lambda q, v, a, t: a[0] ** 2 / 2, ["theta"])
    path = ao.solve(Problem(higher, Event(0, [0.0], v=[0.0]), Event(1, [1.0], v=[0.0])))
    for solution, other in ((own, higher), (path, SYSTEM)):
        solution.save(tmp_path / "one.npz")
        with pytest.raises(ValueError, match="expected a system of order"):
            ao.load(tmp_path / "one.npz", other)


# -- the file itself ------------------------------------------------------------------------------


def test_there_are_no_pickles_in_it(own, tmp_path):
    file = saved(own, tmp_path / "own.npz")
    with np.load(file, allow_pickle=False) as arrays:
        kinds = {name: arrays[name].dtype.kind for name in arrays.files}
    assert set(kinds.values()) <= set("fiuU")
    with zipfile.ZipFile(file) as archive:
        for name in archive.namelist():
            assert b"cnumpy" not in archive.read(name)


def test_names_and_folders(own, tmp_path):
    with pytest.raises(ValueError, match=r"ends in \.npz, found 'solution\.txt'"):
        own.save(tmp_path / "solution.txt")
    with pytest.raises(OSError):
        own.save(tmp_path / "nowhere" / "solution.npz")
    with pytest.raises(FileNotFoundError):
        ao.load(tmp_path / "missing.npz")
    assert not list(tmp_path.iterdir())


# -- what is no solution --------------------------------------------------------------------------


def npz(**arrays):
    memory = io.BytesIO()
    np.savez(memory, **arrays)
    return memory.getvalue()


FOREIGN = {
    "empty": b"",
    "text": b"theta = 0.3\n",
    "a zip of text": None,
    "another npz": npz(x=np.arange(3.0)),
    "an npz of another format": npz(about=np.array(json.dumps({"format": "another 7"}))),
    "an npz with broken text": npz(about=np.array("{")),
    "an npz with a list": npz(about=np.array("[1, 2]")),
    "a pickle": pickle.dumps({"format": 1}),
    "an npz with a pickle": npz(about=np.array({"format": 1}, dtype=object)),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_files_are_refused(kind, tmp_path):
    file = tmp_path / "foreign.npz"
    if FOREIGN[kind] is None:
        with zipfile.ZipFile(file, "w") as archive:
            archive.writestr("readme.txt", "hello")
    else:
        file.write_bytes(FOREIGN[kind])
    with pytest.raises(ValueError, match=r"expected an? (\.npz )?file"):
        ao.load(file)


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_half_a_file_is_refused(own, share, tmp_path):
    file = saved(own, tmp_path / "half.npz")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ValueError, match=r"expected an \.npz file"):
        ao.load(file)


@pytest.mark.slow
def test_a_file_with_any_one_byte_changed_is_refused_or_whole(own, tmp_path):
    file = saved(own, tmp_path / "damaged.npz")
    content, rng = file.read_bytes(), np.random.default_rng(0)
    ends = [*range(0, 40, 2), *range(len(content) - 600, len(content), 4)]  # of the archive
    refused = 0
    for at in [*rng.choice(len(content), 60, replace=False), *ends]:
        changed = bytearray(content)
        changed[at] ^= int(rng.integers(1, 256))
        file.write_bytes(changed)
        try:
            loaded = ao.load(file)
        except ValueError as error:
            refused += 1
            assert str(error).startswith("expected an .npz file") and "pickle" not in str(error)
        else:
            assert_same(loaded, own)  # it was a time stamp, say
    assert refused > 110


WRONG = {
    "an action of three rows": ("action", lambda a: np.ones((3, 3))),
    "an error of text": ("error", lambda a: np.array("small")),
    "too few values": ("values", lambda a: a[:, 1:]),
    "another number of coordinates": ("values", lambda a: np.vstack([a, a])),
    "values that are not finite": ("values", lambda a: a + np.nan),
    "boundaries that decrease": ("boundaries", lambda a: a[::-1]),
    "fractional degrees": ("degrees", lambda a: a + 0.5),
    "one velocity": ("velocities", lambda a: a[:1]),
    "momenta of two coordinates": ("momenta", lambda a: np.hstack([a, a])),
    "multipliers elsewhere": ("lam", lambda a: a[:, 1:]),
    "multipliers of no constraint": ("lam", lambda a: np.zeros((3, a.shape[1]))),
    "infinite multipliers": ("lam", lambda a: np.full((1, a.shape[1]), np.inf)),
    "complex values": ("values", lambda a: a + 1e-3j),
    "complex momenta": ("momenta", lambda a: a + 0j),
    "a complex action": ("action", lambda a: a + 0j),
    "times as text": ("boundaries", lambda a: a.astype(str)),
    "an action in a row": ("action", lambda a: a[None]),
    "an action NaN": ("action", lambda a: a + np.nan),
    "a negative error": ("error", lambda a: -a),
    "an error NaN": ("error", lambda a: a + np.nan),
    "momenta that are not finite": ("momenta", lambda a: a + np.inf),
    "other velocities": ("velocities", lambda a: 3 * a),
    "velocities exchanged": ("velocities", lambda a: a[::-1]),
    "a path beside its events": ("values", lambda a: a + 1e-6),
    "a path at another time": ("boundaries", lambda a: a + 1e-6),
    "times since another start": ("since", lambda a: a + 1e-12),
    "times of other elements": ("since", lambda a: a**2 / a[-1]),
    "too few times": ("since", lambda a: a[1:]),
    "times that are not finite": ("since", lambda a: a + np.nan),
}


@pytest.mark.parametrize("what", WRONG)
def test_arrays_that_do_not_fit_are_refused(own, what, tmp_path):
    name, change = WRONG[what]
    file = saved(own, tmp_path / "wrong.npz", **{name: change})
    for system in (None, SYSTEM):
        with pytest.raises(ValueError, match=r"expected an \.npz file.*solve and save again"):
            ao.load(file, system)


WORDS = {
    "an unknown status": ("status", lambda a: "FINE", "one of the statuses SOLVED, .*found 'FINE'"),
    "no status": ("status", lambda a: None, "one of the statuses"),
    "figures in a row": ("stats", lambda a: [1, 2], ""),
    "a gain of text": ("stats", lambda a: {**a, "gain": "high"}, "a number as the gain"),
    "rows of constraints": ("stats", lambda a: {**a, "rows": 7}, "multipliers of 7 rows"),
    "a parameter NaN": ("parameters", lambda a: {**a, "l": np.nan}, "finite parameter"),
    "another end": ("events", lambda a: [a[0], [1.0, [0.5]]], "through its events, .* 0.5"),
    "another time": ("events", lambda a: [a[0], [1.5, a[1][1]]], "the times of its events"),
    "closed ends": ("advance", lambda a: [0.0], "after its advance"),
    "ends that close elsewhere": ("advance", lambda a: [1.0], "after its advance"),
}


@pytest.mark.parametrize("what", WORDS)
def test_words_that_do_not_fit_are_refused(own, what, tmp_path):
    name, change, why = WORDS[what]
    file = saved(own, tmp_path / "wrong.npz", **{name: change})
    for system in (None, SYSTEM):
        with pytest.raises(
            ValueError, match=rf"expected an \.npz file.*{why}.*solve and save again"
        ):
            ao.load(file, system)


NEARLY = {
    # name: array, where, by how much it may be off, and by how much not
    "a velocity": ("velocities", (0, 0), 1e-9, 1e-4),
    "a momentum": ("momenta", (1, 0), 1e-9, 1e-4),
    "a first coordinate": ("values", (0, 0), 1e-13, 1e-6),
    "a last coordinate": ("values", (0, -1), 1e-13, 1e-6),
    "the first time": ("boundaries", (0,), 1e-13, 1e-6),
    "the last time": ("boundaries", (-1,), 1e-13, 1e-6),
}


@pytest.mark.quick(
    "a velocity-1.0",
    "a momentum--1.0",
    "a first coordinate-1.0",
    "a last coordinate--1.0",
    "the first time-1.0",
    "the last time--1.0",
)
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("what", NEARLY)
def test_numbers_may_be_rounded_and_not_changed(own, what, side, tmp_path):
    name, where, little, much = NEARLY[what]

    def moved(by):
        def change(a):
            a[where] += by
            return a

        return ao.load(saved(own, tmp_path / "own.npz", **{name: change}), SYSTEM)

    assert moved(side * little).success
    with pytest.raises(ValueError, match=r"expected an \.npz file.*solve and save again"):
        moved(side * much)


PHYSICS = {
    "momenta": lambda a: 3 * a,
    "momenta a little off": lambda a: a * (1 + 1e-5),
    "velocities a little off": lambda a: a * (1 + 1e-5),
    "lam": lambda a: np.full((2, a.shape[1]), np.nan),
}


@pytest.mark.parametrize("what", PHYSICS)
def test_what_the_system_contradicts_is_refused(own, what, tmp_path):
    file = saved(own, tmp_path / "wrong.npz", **{what.split()[0]: PHYSICS[what]})
    with pytest.raises(ValueError, match=r"expected an \.npz file.*(of the system|constraints)"):
        ao.load(file, SYSTEM)


@pytest.mark.parametrize("stats", [{}, {"rung": "least"}])
def test_figures_are_for_reading_and_no_guess_needs_them(own, stats, tmp_path):
    file = saved(own, tmp_path / "own.npz", stats=lambda a: stats)
    loaded = ao.load(file, SYSTEM)
    assert loaded.stats == stats
    assert ao.solve(own.problem, guess=loaded, tol=1e-9).success


@pytest.mark.long
def test_coarse_paths_and_paths_at_rest_pass(tmp_path):
    # The momentum's velocity is far from the polynomial's, or both are zero up to rounding.
    fall = System(lambda q, v, t: v[0] ** 2 / 2 - abs(q[0]), ["x"])
    plane = System(lambda q, v, t: (v @ v - q @ q) / 2 - q[1] ** 4, ["x", "y"])
    coarse = ao.Mesh.uniform(0.0, 2.0, 2, 1)
    kink = Problem(fall, Event(0, [1.0]), Event(2, [0.0]))
    swing_ = Problem(SYSTEM, Event(0.0, 0.3), Event(2.0, -0.2))
    solutions = [
        ao.solve(kink, throw=False),
        ao.solve(swing_, mesh=coarse),
        ao.solve(Problem(plane, Event(0, [1.0, np.sin(np.pi)]), Event(1, [0.3, 0.0]))),
        ao.solve(Problem(plane, Event(0, [0.0, 0.0]), Event(1, [0.0, 0.0]))),
    ]
    for i, solution in enumerate(solutions):
        solution.save(tmp_path / f"{i}.npz")
        for system in (None, solution.problem.system):
            assert_same(ao.load(tmp_path / f"{i}.npz", system), solution)


def test_an_attempt_whose_action_is_infinite_can_be_kept(tmp_path):
    pole = System(lambda q, v, t: v[0] ** 2 / 2 + q[0] / (t - 0.5), ["x"])
    attempt = ao.solve(Problem(pole, Event(0.0, [1.0]), Event(1.0, [2.0])), throw=False)
    assert not attempt.success and attempt.action == np.inf
    attempt.save(tmp_path / "failed.npz")
    assert_same(ao.load(tmp_path / "failed.npz", pole), attempt)


def test_what_is_no_file_or_system_is_refused(own, tmp_path):
    for nothing in (None, 3.5, tmp_path):
        with pytest.raises(ValueError, match=r"expected an \.npz file"):
            ao.load(nothing)
    own.save(tmp_path / "own.npz")
    for nothing in (3, swing):
        with pytest.raises(ValueError, match="expected a System or the name of a scene"):
            ao.load(tmp_path / "own.npz", nothing)


@pytest.mark.parametrize("missing", ["about", "values", "degrees", "lam"])
def test_a_file_without_one_of_its_parts_is_refused(own, missing, tmp_path):
    file = saved(own, tmp_path / "part.npz")
    with np.load(file) as arrays:
        rest = {name: arrays[name] for name in arrays.files if name != missing}
    np.savez(file, **rest)
    with pytest.raises(ValueError, match=r"expected an \.npz file"):
        ao.load(file, SYSTEM)


LEVEL = lambda level: System(  # noqa: E731
    lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2 + level, ["x"]
)
GAUGED = lambda level: System(  # noqa: E731
    lambda q, v, t: (v[0] ** 2 - q[0] ** 2) / 2 + level * v[0], ["x"]
)
ROUNDED = [  # system, last time, array, how it is changed by some number: a fitting one, and not
    # A total time derivative adds a constant to all momenta and nothing to the action's unit.
    *((GAUGED(p), 1.0, "momenta", lambda p, by: p * (1 + by), 1e-7, 1e-5) for p in (1e3, -1e3)),
    # A quarter of an oscillator's period has S = 0 up to rounding; a part of it has not.
    *((LEVEL(0), T, "action", lambda S, by: S + by, 1e-13, 1e-7) for T in (np.pi / 2, 1.0)),
    # A constant in L is no energy of the motion, and has rounding of its own.
    *((LEVEL(c), 1.0, "action", lambda S, by: S * (1 + by), 1e-11, 1e-6) for c in (1e6, -1e6)),
]


@pytest.mark.long
@pytest.mark.parametrize(("system", "T", "name", "change", "little", "much"), ROUNDED)
def test_sums_may_be_rounded_by_the_size_of_their_terms(
    system, T, name, change, little, much, tmp_path
):
    solution = ao.solve(Problem(system, Event(0.0, [1.0]), Event(T, [np.cos(T)])), tol=1e-12)
    for by in (little, -little, much, -much):
        file = saved(solution, tmp_path / "one.npz", **{name: lambda x, by=by: change(x, by)})
        if abs(by) == little:
            assert ao.load(file, system).success
        else:
            with pytest.raises(ValueError, match=r"whose action on its path is|the momenta of the"):
                ao.load(file, system)


# -- the wrong system -----------------------------------------------------------------------------


def bent(q, v, t, *, l, g):
    return swing(q, v, t, l=l, g=g) + q[0] ** 2 / 100


OTHERS = [
    (System(swing, ["phi"], parameters={"l": 1.0, "g": 9.81}), "coordinates theta .* found phi"),
    ("kepler", "coordinates theta .* found x, y"),
    ("pendulem", "unknown scene 'pendulem'; did you mean 'pendulum'"),
    (
        System(lambda q, v, t, *, k: v[0] ** 2 / 2 - k * q[0], ["theta"], parameters={"k": 1.0}),
        "unknown parameter",
    ),
    (System(bent, ["theta"], parameters={"l": 1.0, "g": 9.81}), "whose action on its path is"),
]


@pytest.mark.parametrize(("system", "match"), OTHERS)
def test_another_system_is_refused(own, system, match, tmp_path):
    own.save(tmp_path / "own.npz")
    with pytest.raises(ValueError, match=match):
        ao.load(tmp_path / "own.npz", system)


def test_a_namesake_of_a_scene_is_no_scene(tmp_path):
    # A system of one's own that happens to be called like a scene: the path, and no physics.
    namesake = System(swing, ["theta"], parameters={"l": 1.0, "g": 9.81}, name="kepler")
    solution = ao.solve(Problem(namesake, Event(0, 0.3), Event(1, -0.2)))
    solution.save(tmp_path / "namesake.npz")
    loaded = ao.load(tmp_path / "namesake.npz")
    assert_same(loaded, solution)
    with pytest.raises(ValueError, match="without its system"):
        loaded.energy(0.5)
