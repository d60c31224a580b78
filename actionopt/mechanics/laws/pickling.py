"""Systems carried to other processes: a law is loaded once in a process, with what is derived."""

from __future__ import annotations

import pickle
import threading
from collections import deque
from typing import Any
from weakref import WeakValueDictionary

import casadi as ca

from actionopt.mechanics.laws.compiled import Pointwise
from actionopt.mechanics.laws.tracing import ParameterTable, Symbols

# Attributes that travel with a system if they are there, besides its functions.
TRAVELLING = (
    "structure", "switches", "clock", "pulses", "steps_along", "energy_is_mechanical"
)  # fmt: skip
KEPT_SYSTEMS = 8  # that were loaded, whether or not they are in use: a worker's, ad hoc

_KNOWN: WeakValueDictionary[str, Any] = WeakValueDictionary()  # by digest: pickled or loaded
_RECENT: deque[Any] = deque(maxlen=KEPT_SYSTEMS)  # loaded: workers need them again and again
_LOADING = threading.RLock()


def reduce(system: Any) -> tuple:
    """Return what pickles a `System`: its law as an expression, and the functions derived of it."""
    digest, version = system.digest, ca.CasadiMeta.version()
    with _LOADING:
        _KNOWN.setdefault(digest, system)
    with system.lock:
        kept = {name: vars(system)[name] for name in TRAVELLING if name in vars(system)}
        made = {name: x for name, x in system._made.items() if _travels(x)}
        pointwise = {name: x for name, x in system._pointwise.items() if _travels(x)}
        parts = pointwise, made, kept
        known = system.coordinates, system.table.defaults, system.name, system.source
        state = pickle.dumps((*known, system._law.serialize(), parts))
        derived = sorted(name for x in parts for name in x)
        return load, (type(system), digest, derived, version, state)


def _travels(made: object) -> bool:
    """Whether what is derived can be read elsewhere.

    CasADi writes functions that solve linear equations in a way that it does not read.
    """
    function = made.function if isinstance(made, Pointwise) else made
    return made is None or (isinstance(function, ca.Function) and function.is_a("SXFunction"))


def load(cls: type, digest: str, derived: list[str], version: str, state: bytes) -> Any:
    """Return the system of a law, of the class `cls`, which is made once in a process.

    Raises ValueError if it was pickled with another CasADi, whose expressions this one cannot read.
    """
    with _LOADING:
        system = _KNOWN.get(digest)
        if system and {*system._pointwise, *system._made, *vars(system)}.issuperset(derived):
            return system
        try:
            coordinates, defaults, name, source, law, parts = pickle.loads(state)
        except RuntimeError as error:
            raise ValueError(
                f"expected a system that CasADi {ca.CasadiMeta.version()} can read, found one that "
                f"was pickled with {version}; use the same version on both sides"
            ) from error
        if system is None:
            table = ParameterTable(defaults)
            known = ca.Function.deserialize(law)
            order = known.numel_in(0) // len(coordinates)
            symbols = Symbols.of(len(coordinates), table, order)
            laws = known.call([symbols.q, symbols.v, symbols.t, symbols.p])
            system = cls.of_laws(symbols, laws, coordinates, table, name, source, True)
            _KNOWN[digest] = system
            _RECENT.append(system)
        with system.lock:
            for own, part in zip(
                (system._pointwise, system._made, vars(system)), parts, strict=True
            ):
                for key, value in part.items():
                    own.setdefault(key, value)
        return system
