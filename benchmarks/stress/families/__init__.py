"""One module a family: TITLE, `cases(quick)` and `criteria(rows)`."""

from benchmarks.stress.families import (
    bodies,
    clocks,
    conjugate,
    constraints,
    kink,
    large,
    layers,
    origins,
    pendulums,
    pulses,
    random_systems,
    repeats,
    threads,
    turning,
    units,
)

FAMILIES = {
    module.__name__.rsplit(".", 1)[1]: module
    for module in (
        pendulums,
        bodies,
        layers,
        turning,
        kink,
        conjugate,
        large,
        constraints,
        units,
        repeats,
        pulses,
        origins,
        clocks,
        threads,
        random_systems,
    )
}
