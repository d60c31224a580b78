"""Test problems for optimisers: stationary action on a mesh, any size, with known answers.

>>> problem = get("oscillator", elements=4, degree=4)
>>> problem.classification, problem.kind
('QUR2-MN-15-0', 'minimum')
>>> find(tags="near collision", constrained=False)[0]
'kepler_near_collision'
"""

from __future__ import annotations

import inspect
from collections.abc import Collection
from typing import Any

from actionopt.mechanics.laws.tracing import suggestion
from actionopt.suite.families import FAMILIES, Family
from actionopt.suite.member import Member
from actionopt.suite.models import MODELS, Model
from actionopt.suite.problem import TestProblem
from actionopt.tools.checks import among, entries, flag, numbers, whole

__all__ = ["FAMILIES", "MODELS", "Family", "Model", "TestProblem", "find", "get", "model"]


def get(
    name: str,
    elements: int | None = None,
    degree: int | None = None,
    *,
    decades: float | None = None,
    **parameters: Any,
) -> TestProblem:
    """Return the member of a family with so many elements of one degree.

    The units of its unknowns range over so many decades, from the first to the last.

    Raises ValueError if there is no such family or parameter, or the mesh makes no sense.
    """
    if not among(name, FAMILIES):
        raise ValueError(
            f"unknown test problem {name!r}{suggestion(str(name), tuple(FAMILIES))}; "
            "actionopt.suite.find() names all"
        )
    return TestProblem(FAMILIES[name], elements, degree, decades, parameters)


def model(name: str, **parameters: Any) -> Model:
    """Return a model by its name, one of `MODELS`: no discrete action, but written down as it is.

    Raises ValueError if there is no such model or parameter, or its value makes no sense.
    """
    if not among(name, MODELS):
        raise ValueError(
            f"unknown model {name!r}{suggestion(str(name), tuple(MODELS))}; "
            f"there are {', '.join(MODELS)}"
        )
    known = inspect.signature(MODELS[name]).parameters
    for word in parameters:
        if word not in known:
            raise ValueError(
                f"unknown parameter {word!r} of {name}{suggestion(word, tuple(known))}; "
                f"it has {', '.join(known)}"
            )
    made = MODELS[name](**parameters)
    made.parameters = parameters
    return made


def member(
    name: str, elements: int | None = None, degree: int | None = None, **parameters: Any
) -> Member:
    """Return the member of a family, or the model, of this name.

    Raises ValueError as `get` and `model` do.
    """
    if not among(name, MODELS):
        return get(name, elements, degree, **parameters)
    mesh = {"elements": elements, "degree": degree}
    return model(name, **{k: v for k, v in mesh.items() if v is not None}, **parameters)


def find(
    *,
    kind: str | None = None,
    constrained: bool | None = None,
    index: int | None = None,
    size: tuple[int, int] | None = None,
    tags: str | Collection[str] = (),
    convex: bool | None = None,
) -> list[str]:
    """Return the names of the families whose default members fit.

    Parameters
    ----------
    kind : {"minimum", "saddle", "degenerate"}, optional
        What the optimum is.
    constrained : bool, optional
        Whether there are constraint rows.
    index : int, optional
        Morse index of the discrete optimum.
    size : (least, most), optional
        Range of the number of unknowns n.
    tags : str or collection of str
        All of these.
    convex : bool, optional
        Whether f is convex along the constraints.

    Raises
    ------
    ValueError
        For a kind or a tag that there is not, a `size` of other than two numbers, or what is no
        whole number or neither true nor false.
    """
    if not (kind is None or among(kind, ("minimum", "saddle", "degenerate"))):
        raise ValueError(f"expected a kind of minimum, saddle or degenerate, found {kind!r}")
    wanted: list[Any] = [tags] if (several := entries(tags)) is None else several
    known = {tag for family in FAMILIES.values() for tag in family.tags}
    for tag in wanted:
        if not among(tag, known):
            raise ValueError(f"unknown tag {tag!r}; the tags are {', '.join(sorted(known))}")
    if size is not None and numbers(size, "size").shape != (2,):
        raise ValueError(f"expected size=(least, most) numbers of unknowns, found {size!r}")
    for name, asked in (("constrained", constrained), ("convex", convex)):
        if asked is not None:
            flag(asked, name)
    if index is not None:
        whole(index, "index", 0)
    found = [name for name, family in FAMILIES.items() if set(wanted) <= set(family.tags)]
    if all(x is None for x in (kind, constrained, index, size, convex)):
        return found  # none is made for that

    def fits(problem: TestProblem) -> bool:
        return (
            (constrained is None or constrained == bool(problem.m))
            and (size is None or size[0] <= problem.n <= size[1])
            # What needs the optimum is asked last.
            and (kind is None or kind == problem.kind)
            and (index is None or index == problem.index_star)
            and (convex is None or convex == problem.convex)
        )

    return [name for name in found if fits(get(name))]
