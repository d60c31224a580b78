"""How time is discretized: element boundaries and the polynomial degree of each element."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from actionopt.tools.cached import cached_property
from actionopt.tools.checks import number, numbers, whole
from actionopt.tools.immutable import immutable, make_unchecked
from actionopt.tools.lobatto import RESTING, Rule, lgl, open_rule
from actionopt.tools.types import Array, NDInt

MAX_DEGREE = 64  # ad hoc; the slopes of a sine have still 12 digits there


@immutable
class Group:
    """The E elements of one degree d, by their d + 1 nodes."""

    rule: Rule
    elements: NDInt  # (E,)
    nodes: NDInt  # (E, d + 1)
    # Where they are among the nodes of all elements, group by group: nodes between elements stand
    # there twice.
    span: slice


# Nodes up to which shapes are kept, and how many, the latest used: some ten MB at most, with all
# that is numbered by them (`layout`); ad hoc.
KEPT_NODES, SHAPES_KEPT = 2**10, 64
# Of the duration: the first or last element below which ends move along lines. Derived: round-off
# of its entries is EPS / 1e-6 of a second derivative, which has ten digits.
SHORT_END = 1e-6


class Elements:
    """The elements and nodes of all meshes whose elements have these degrees."""

    def __init__(self, degrees: tuple[int, ...], singular_ends: tuple[int, int]) -> None:
        self.degrees, self.singular_ends = degrees, singular_ends
        self.elements = len(degrees)
        self.offsets = np.concatenate([[0], np.cumsum(degrees)])  # as `Mesh` has it

    @cached_property
    def groups(self) -> list[Group]:
        """Elements of equal degree together; those with an open end apart."""
        degrees, first = np.array(self.degrees), 0
        kinds = [(lgl(d), np.flatnonzero(degrees == d)) for d in sorted(set(self.degrees))]
        if any(self.singular_ends):
            kinds = self._set_apart(kinds)
        result = []
        for rule, which in kinds:
            nodes = self.offsets[which][:, None] + np.arange(rule.degree + 1)
            result.append(Group(rule, which, nodes, slice(first, first + nodes.size)))
            first += nodes.size
        return result

    def _set_apart(self, kinds: list[tuple[Rule, NDInt]]) -> list[tuple[Rule, NDInt]]:
        """Return rules and elements, those with an open end taken out of the others."""
        sides = np.zeros((self.elements, 2), dtype=int)
        sides[0, 0], sides[-1, 1] = self.singular_ends
        apart = np.flatnonzero(sides.any(axis=1))
        inner = [(rule, np.setdiff1d(which, apart)) for rule, which in kinds]
        found = [(open_rule(self.degrees[e], tuple(sides[e].tolist())), e) for e in apart]
        return [(rule, np.array([e])) for rule, e in found] + [k for k in inner if k[1].size]


_shape = lru_cache(SHAPES_KEPT)(Elements)


@immutable
class Mesh:
    """How to discretize time: element boundaries and the polynomial degree of each element.

    Parameters
    ----------
    boundaries : (N + 1,) array
        Strictly increasing times; the ends are the times of the two events.
    degrees : int or (N,) array of int
        Polynomial degree of each element, from 1 to 64; one integer serves all.

    Attributes
    ----------
    since : (N + 1,) array
        The boundaries measured from the first of them. Far from zero, where times are rounded
        coarsely, an element may be shorter than `boundaries` can tell.
    singular_ends : tuple of int
        What the start and the end are: 0, or `lobatto.OPEN` or `RESTING` where L is infinite.

    Raises
    ------
    ValueError
        If the boundaries do not increase or are not finite, or a degree is out of range.

    Examples
    --------
    >>> mesh = Mesh.uniform(0.0, 1.0, elements=4, degree=6)
    >>> mesh.elements, mesh.nodes.size
    (4, 25)
    """

    boundaries: Array
    degrees: tuple[int, ...]
    since: Array
    singular_ends: tuple[int, int]

    def __init__(self, boundaries: ArrayLike, degrees: int | ArrayLike) -> None:
        times = numbers(boundaries, "the boundaries of a mesh")
        since = times - times[0] if times.ndim == 1 and times.size else times
        if times.ndim == 1 and np.all(np.diff(times) > 0):
            # Nearer to zero than the first, times may be told apart that are not from there.
            for k in np.flatnonzero(np.diff(since) <= 0):
                since[k + 1] = np.nextafter(since[k], np.inf)
        self._set(times, since, degrees)

    def _set(
        self,
        boundaries: Array,
        since: Array,
        degrees: int | ArrayLike,
        singular_ends: tuple[int, int] = (0, 0),
    ) -> None:
        """Set the attributes, read-only, and raise what the class raises."""
        _check_increasing(since)
        for name, row in (("boundaries", boundaries), ("since", since)):
            row.setflags(write=False)
            object.__setattr__(self, name, row)
        object.__setattr__(self, "degrees", _degrees(degrees, since.size - 1))
        object.__setattr__(self, "singular_ends", singular_ends)

    def __reduce__(self) -> tuple:
        """Carry what the rest is made of."""
        return restore_mesh, (self.boundaries, self.since, self.degrees, self.singular_ends)

    def __repr__(self) -> str:
        """Show the sizes, not the arrays."""
        low, high = min(self.degrees), max(self.degrees)
        degrees = f"degree {low}" if low == high else f"degrees {low} to {high}"
        first, *_, last = self.boundaries.tolist()
        return f"Mesh(elements {self.elements}, {degrees}, from t = {first:g} to {last:g})"

    @classmethod
    def uniform(cls, start: float, end: float, elements: int, degree: int) -> Mesh:
        """Return `elements` equal elements of one degree over the times [start, end].

        Raises ValueError for bad numbers.
        """
        start, end = number(start, "the start of a mesh"), number(end, "the end of a mesh")
        elements, duration = whole(elements, "the number of elements", 1), end - start
        since = np.arange(elements + 1) * (duration / elements)
        since[-1] = duration
        return cls.over(start, end, since, degree)

    @staticmethod
    def over(
        start: float,
        end: float,
        since: Array,
        degrees: int | ArrayLike,
        singular_ends: tuple[int, int] = (0, 0),
    ) -> Mesh:
        """Return a mesh over [start, end] whose boundaries (N + 1,) are measured from `start`.

        They begin with 0 and end with the duration. Raises ValueError as the class does.
        """
        boundaries = start + since
        boundaries[-1] = end
        return restore_mesh(boundaries, np.array(since), degrees, singular_ends)

    def cut(self, since: Array, degrees: int | ArrayLike | None = None) -> Mesh:
        """Return other elements over the same times; `since` as for `over`.

        Of no degrees they have those of the elements in which their middles are.
        """
        if degrees is None:
            middles = (since[:-1] + since[1:]) / 2
            degrees = np.array(self.degrees)[np.searchsorted(self.since, middles) - 1]
        return Mesh.over(
            self.boundaries[0], self.boundaries[-1], since, degrees, self.singular_ends
        )

    def with_times(self, since: Array) -> Mesh:
        """Return elements of the same degrees over other times; `since` as for `over`."""
        boundaries = self.boundaries[0] + since
        boundaries[-1] = self.boundaries[-1]
        return self._with_times(boundaries, since)

    def divide(self, parts: ArrayLike, degrees: ArrayLike | None = None) -> Mesh:
        """Return the mesh with each element in so many equal `parts` (N,), each of its degree.

        Or of one of the `degrees` (N,).
        """
        b, counts = self.since, np.asarray(parts)
        pieces = [np.linspace(b[e], b[e + 1], k, endpoint=False) for e, k in enumerate(counts)]
        degrees = np.repeat(self.degrees if degrees is None else degrees, counts)
        return self.cut(np.concatenate([*pieces, b[-1:]]), degrees)

    def part(self, first: int, last: int) -> Mesh:
        """Return the elements from `first` to the one before `last`, as a mesh."""
        return Mesh(self.boundaries[first : last + 1], self.degrees[first:last])

    @property
    def elements(self) -> int:
        """Number of elements N."""
        return len(self.degrees)

    @cached_property
    def lengths(self) -> Array:
        """Element lengths h, shape (N,)."""
        return self.since[1:] - self.since[:-1]

    @property
    def duration(self) -> float:
        """Time from the first boundary to the last."""
        return float(self.since[-1])

    @cached_property
    def shape(self) -> Elements:
        """What it has in common with meshes of the same degrees over any times."""
        made = _shape if sum(self.degrees) <= KEPT_NODES else Elements
        return made(self.degrees, self.singular_ends)

    @property
    def moves_along_lines(self) -> bool:
        """Whether an end moves along a line over the path: it is singular, or an element short."""
        short = min(self.lengths[0], self.lengths[-1]) < SHORT_END * self.duration
        return bool(short or any(self.singular_ends))

    @cached_property
    def offsets(self) -> NDInt:
        """Index of each element's first node, and of the last node: shape (N + 1,)."""
        return self.shape.offsets

    @cached_property
    def nodes(self) -> Array:
        """All nodes in time order, shared ones once, shape (sum of degrees + 1,)."""
        times = self.boundaries[0] + self.nodes_since
        times[self.offsets] = self.boundaries
        return times

    @cached_property
    def nodes_since(self) -> Array:
        """The nodes measured from the first of them, as `since`."""
        times = np.empty(self.offsets[-1] + 1)
        for g in self.groups:
            mid = (self.since[g.elements] + self.since[g.elements + 1])[:, None] / 2
            times[g.nodes] = mid + self.lengths[g.elements][:, None] / 2 * g.rule.nodes
        times[self.offsets] = self.since
        return times

    @cached_property
    def groups(self) -> list[Group]:
        """Elements of equal degree together; those with an open end apart."""
        return self.shape.groups

    def moved(self, start: float, end: float) -> Mesh:
        """Return the same mesh stretched affinely onto the times [start, end].

        Raises ValueError for times that are not finite numbers, or do not increase.
        """
        start, end = number(start, "the start of a mesh"), number(end, "the end of a mesh")
        b = self.boundaries
        if b[0] == start and b[-1] == end:
            return self
        duration = end - start
        since = self.since * (duration / self.duration)
        since[-1] = duration
        boundaries = start + since
        boundaries[-1] = end
        return self._with_times(boundaries, since)

    def _with_times(self, boundaries: Array, since: Array) -> Mesh:
        _check_increasing(since)
        for row in (boundaries, since):
            row.setflags(write=False)
        shape = {k: getattr(self, k) for k in ("degrees", "singular_ends", "shape")}
        return make_unchecked(Mesh, boundaries=boundaries, since=since, **shape)


def with_singular_ends(mesh: Mesh, singular_ends: tuple[int, int]) -> Mesh:
    """Return the mesh with its first and last element open at the ends that are singular."""
    if singular_ends == mesh.singular_ends:
        return mesh
    degrees = np.array(mesh.degrees)
    ends = [e for e, end in zip((0, -1), singular_ends, strict=True) if end]
    degrees[ends] = np.maximum(degrees[ends], 2)
    return restore_mesh(mesh.boundaries, mesh.since, degrees, singular_ends)


def rise(before: Array, after: Array, ends: tuple[int, int]) -> tuple[Array, Array, Array]:
    """Return a curve from 0 to 1, at times `before` and `after` its ends: it, the rest, its rate.

    Straight, but at rest where an end is `RESTING`, as a path is there.
    """
    T = before + after
    s, left = before / T, after / T
    from_rest, to_rest = (end == RESTING for end in ends)
    if from_rest and to_rest:
        return s * s * (s + 3 * left), left * left * (left + 3 * s), 6 * s * left / T
    if from_rest:
        return s * s, left * (1 + s), 2 * s / T
    if to_rest:
        return s * (1 + left), left * left, 2 * left / T
    return s, left, 1 / T


def restore_mesh(
    boundaries: Array,
    since: Array,
    degrees: int | ArrayLike,
    singular_ends: tuple[int, int] = (0, 0),
) -> Mesh:
    """Return the mesh with these boundaries and distances (N + 1,), which are made read-only."""
    mesh = object.__new__(Mesh)
    mesh._set(boundaries, since, degrees, singular_ends)
    return mesh


def _check_increasing(since: Array) -> None:
    """Raise ValueError for other than finite numbers that increase, two at least."""
    if since.ndim != 1 or since.size < 2 or not np.isfinite(since).all():
        raise ValueError(
            "expected at least two finite element boundaries in one row, "
            f"found an array of shape {since.shape}; give the N + 1 times of N elements"
        )
    if not (since[1:] > since[:-1]).all():
        raise ValueError("expected element boundaries that increase strictly; sort them")


def _degrees(degrees: int | ArrayLike, count: int) -> tuple[int, ...]:
    """Return one degree for each of `count` elements. Raises ValueError where there are none."""
    if type(degrees) is int and 1 <= degrees <= MAX_DEGREE:
        return (degrees,) * count
    wanted = f"expected one degree or one for each of the {count} elements"
    try:
        given = np.asarray(degrees)
    except ValueError as error:  # rows of different lengths
        raise ValueError(f"{wanted}, found {degrees!r}") from error
    if given.ndim > 1 or (given.ndim == 1 and given.size != count):
        raise ValueError(f"{wanted}, found an array of shape {given.shape}")
    if given.dtype.kind not in "iu" or given.min() < 1 or given.max() > MAX_DEGREE:
        raise ValueError(
            f"expected integer degrees from 1 to {MAX_DEGREE}, found {degrees!r}; "
            "use more elements instead of a higher degree"
        )
    return tuple(np.broadcast_to(given, (count,)).tolist())
