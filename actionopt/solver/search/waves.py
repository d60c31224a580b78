"""First paths along which integrals have given values: straight ones that are bent by waves.

Newton's method finds from them a stationary path and its multipliers, not always the nearest one.
Where the values are far from those of the straight line it finds none from a sine, and the values
are led there step by step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from actionopt.discrete.action.projection import project
from actionopt.discrete.action.transcription import Transcription
from actionopt.discrete.borders.bordered import Bordered
from actionopt.discrete.borders.borders import Integral, times_of
from actionopt.discrete.borders.integrals import integrals
from actionopt.discrete.meshes.element import with_degrees
from actionopt.discrete.meshes.mesh import Mesh
from actionopt.discrete.meshes.path import Path
from actionopt.discrete.newton.discrete_path import DiscretePath
from actionopt.discrete.newton.newton import approach
from actionopt.mechanics.question.problem import Problem
from actionopt.solver.refinement.first_mesh import COARSE_DEGREE, COARSE_ELEMENTS, FIRST_TOL
from actionopt.solver.refinement.signals import HALVINGS
from actionopt.solver.refinement.workspace import PATIENT
from actionopt.solver.search.eigenvectors import Eigenvectors, eigenvectors
from actionopt.tools.types import EPS, RANK, Array

# Ad hoc. Of a first path: half waves, and the power of a sine that keeps them in the middle.
WAVES, NARROW = 6, 8
LAST_PROJECTION = 1e-6  # step to the values of integrals
# Eigenvectors: one for so many first paths, and so many at least.
STARTS_A_STATE, LEAST_STATES = 10, 4
# First paths before a continuation in the values, and its first part of the way.
BEFORE_CONTINUATION, FIRST_PART = 4, 0.1


def first_waves(
    problem: Problem,
    straight: Path,
    times: Array,
    size: Array,
    count: int,
    random: np.random.Generator,
) -> Iterator[tuple[Path, Array]]:
    """Yield at most `count` first paths along which the integrals have the values that are given.

    And the times of the events on them. The one nearest to the straight line, if it is near; then
    one sine each in turn, up and down, and random sums of them, in units of `size` (n,). Where all
    of these leave the integrals as they are, events that differ by round-off gave it, and the
    units are one.
    """
    mesh, legs = wave_mesh(times, problem.system.order), np.diff(times)
    values, n = straight(mesh.nodes), problem.system.n
    at = problem.loose.found_at(times)
    waves = _waves((mesh.nodes - times[0]) / (times[-1] - times[0]), problem.advance is not None)
    for joint in times[1:-1]:  # places that are given stay
        waves = waves * np.tanh(WAVES * np.abs(mesh.nodes - joint) / legs.min())
    asked = np.array(problem.integral)
    for unit in (size, np.ones(n)):
        tr = Transcription(at, mesh, unit)
        shapes = np.einsum("kt,ij->kijt", waves, np.diag(unit)).reshape(-1, n, mesh.nodes.size)
        origin = tr.pack(values.T)
        variations = np.array([tr.pack((values + shape).T) - origin for shape in shapes])
        ends = origin, origin + variations.sum(axis=0)
        first, bent = (integrals(DiscretePath(tr, z))[0] for z in ends)
        if not (np.abs(bent - first) <= EPS * np.abs(asked - first)).all():  # or not a number
            break
    finer = wave_mesh(times, problem.system.order, 2 * COARSE_ELEMENTS)
    wanted = max(count // STARTS_A_STATE, LEAST_STATES)

    def along_states(states: Eigenvectors | None) -> Iterator[tuple[Path, Array]]:
        for path in _along_each(states, asked) if states else ():
            yield path, times

    with_all = problem.loose.found_at(times, kappa=np.ones(asked.size))
    may_be_answers = with_all.system.structure.linear
    states = eigenvectors(at, straight, finer, unit, wanted) if may_be_answers else None
    if states is not None and states.are_answers:
        yield from along_states(states)
        return

    def project_path(z: Array) -> Path:
        path = DiscretePath(tr, z).path
        return Path(mesh, project(tr, path.values.T).T) if tr.layout.rows else path

    straight_on = np.zeros(len(shapes))
    step = _correct(tr, origin, variations, straight_on, asked)[1]
    # Less than by a sine; not where slopes vanish, as of the length of the shortest path.
    if 0 < np.abs(step).max() <= 1:
        nearest = _project(tr, origin, variations, straight_on, asked)
        if nearest is not None:
            yield project_path(nearest), times
    for k in range(count):
        if k == BEFORE_CONTINUATION:
            yield from _continue(problem, tr, origin, variations)
            if not may_be_answers:  # they are asked for where the sines have led to nothing
                states = eigenvectors(at, straight, finer, unit, wanted)
            yield from along_states(states)
        which, sign = divmod(k, 2)
        amplitudes = np.zeros(len(shapes))
        if which < len(shapes):
            amplitudes[which] = 1.0 - 2.0 * sign
        else:
            decay = np.exp(-random.uniform(0, 1) * np.arange(len(shapes)) / n)
            amplitudes = random.standard_normal(len(shapes)) * decay * np.exp(random.normal())
        found = _project(tr, origin, variations, amplitudes, asked)
        if found is not None:
            yield project_path(found), times


def _waves(s: Array, closed: bool) -> Array:
    """Return waves (k, K) at parts s (K,) of the duration: half waves that vanish at the ends.

    Or of a closed path constants, and whole waves.
    """
    if closed:
        turns = 2 * np.pi * np.arange(WAVES // 2 + 1)[:, None] * s
        waves = np.stack([np.cos(turns), np.sin(turns)], axis=1).reshape(-1, s.size)
        return np.delete(waves, 1, axis=0)
    waves = np.sin(np.pi * np.arange(1, WAVES + 1)[:, None] * s)
    narrow = waves * np.sin(np.pi * s) ** NARROW
    return np.concatenate([waves[:1], narrow, waves[1:]])


def _along_each(states: Eigenvectors, values: Array) -> Iterator[Path]:
    """Yield paths on which integrals have these values (c,), the straight one with one vector each.

    Where they are the answers a state and its negative are one.
    """
    for vector in np.eye(len(states.rows)):
        for sign in (1.0,) if states.are_answers else (1.0, -1.0):
            found = _project(states.tr, states.origin, states.rows, sign * vector, values)
            if found is not None:
                yield DiscretePath(states.tr, found).path


def wave_mesh(times: Array, order: int = 1, elements: int = COARSE_ELEMENTS) -> Mesh:
    """Return a mesh for waves between events at times (k + 2,), for paths of an order."""
    legs = np.diff(times)
    parts = np.maximum(1, np.ceil(elements * legs / legs.sum()).astype(int))
    ends = zip(times[:-1], times[1:], parts, strict=True)
    b = [np.linspace(a, e, k, endpoint=False) for a, e, k in ends]
    return with_degrees(Mesh(np.append(np.concatenate(b), times[-1]), COARSE_DEGREE), order)


def _continue(
    problem: Problem, tr: Transcription, origin: Array, variations: Array
) -> Iterator[tuple[Path, Array]]:
    """Yield paths that a continuation in the values of the integrals leads to.

    Where they are far from those of the straight line, a path bent by a sine is far from a
    stationary one: a rope much longer than its span is no sine.
    """
    first, last = integrals(DiscretePath(tr, origin))[0], np.array(problem.integral)
    first_sine = np.eye(len(variations))[0]
    for sign in (1.0, -1.0):
        for share in FIRST_PART / 2.0 ** np.arange(HALVINGS):
            values = first + share * (last - first)
            z = _project(tr, origin, variations, sign * first_sine, values)
            if z is None:
                break
            found = list(lead(problem, DiscretePath(tr, z), None, float(share)))
            yield from found
            if found:
                break


def first_guessed(problem: Problem, path: Path, times: Array) -> Iterator[tuple[Path, Array]]:
    """Yield a guess, and where a continuation leads from the path near it without integrals."""
    if problem.system.m:
        at = Transcription(problem.loose.found_at(times), path.mesh, np.ones(problem.system.n))
        path = Path(path.mesh, project(at, path.values.T).T)
    yield path, times
    lengths, none = problem.found_at(times).lengths, np.zeros(np.size(problem.integral or ()))
    path = path.on(with_degrees(path.mesh, problem.system.order))
    whole, y = Bordered.around(problem, path, None, lengths, times=times, kappa=none)
    equations, places = whole.without(Integral)
    found = approach(equations, y[places], PATIENT)
    if found is not None:
        yield from lead(problem, equations.discrete(found[0]), none)


def lead(
    problem: Problem, at: DiscretePath, kappa: Array | None, share: float = 0.0
) -> Iterator[tuple[Path, Array]]:
    """Yield the path that a continuation leads to as integrals grow to the values asked.

    From a path whose integrals have `share` of that way behind them, to the multipliers of which
    `kappa` (c,) are near, if they are known.
    """
    asked, lengths = np.array(problem.integral), at.tr.lengths
    first = (integrals(at)[0] - share * asked) / (1 - share)
    path, times = at.path, times_of(at.problem)
    step, now = FIRST_PART, share or FIRST_PART
    for _ in range(2 * PATIENT):
        near = problem.replace(integral=first + now * (asked - first))
        known = {"times": times, "kappa": kappa}
        equations, y = Bordered.around(near, path, None, lengths, **known)
        found = approach(equations, y, PATIENT)
        if found is None and kappa is None:
            return
        if found is None:
            step /= 2
            if step < FIRST_PART / 2.0**HALVINGS:
                return
        else:
            at = equations.discrete(found[0])
            share, path, kappa, step = now, at.path, at.problem.kappa, step * 2
            times = times_of(at.problem)
            if share == 1.0:
                yield path, times
                return
        now = min(share + step, 1.0)


def _project(
    tr: Transcription, origin: Array, variations: Array, a: Array, values: Array
) -> Array | None:
    """Return unknowns origin + a.variations with these integrals (c,); None if none is found.

    Gauss and Newton's method takes steps of least length in the amplitudes a. It begins where a
    are of the size asked: a length grows with their square, and the steps down to a rope that is
    hardly longer than the straight line would turn from side to side.
    """
    off = np.abs(_correct(tr, origin, variations, a, values)[0])
    while a.any() and np.isfinite(off).all():
        halved = np.abs(_correct(tr, origin, variations, a / 2, values)[0])
        if not (halved.max() < off.max()):
            break
        a, off = a / 2, halved
    for _ in range(2 * PATIENT):
        off, step = _correct(tr, origin, variations, a, values)
        if not (np.isfinite(off).all() and np.isfinite(step).all()):
            return None
        if np.abs(step).max() <= LAST_PROJECTION * np.abs(a).max():
            near = np.abs(off).max() <= FIRST_TOL * max(1.0, np.abs(values).max())
            return origin + a @ variations if near else None
        longest = max(1.0, float(np.abs(a).max()))
        a = a + step * min(1.0, longest / float(np.abs(step).max()))
    return None


def _correct(
    tr: Transcription, origin: Array, variations: Array, a: Array, values: Array
) -> tuple[Array, Array]:
    """Return by how much integrals (c,) are off, and the least step in a that mends it.

    To first order; NaN where they are no numbers.
    """
    reached, slopes = integrals(DiscretePath(tr, origin + a @ variations))
    off, J = reached - values, slopes @ variations[:, : slopes.shape[1]].T
    if not (np.isfinite(off).all() and np.isfinite(J).all()):
        return off, np.full(a.size, np.nan)
    return off, -np.linalg.pinv(J, rcond=RANK) @ off
