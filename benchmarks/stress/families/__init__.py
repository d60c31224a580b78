"""One module a family: TITLE, `cases(quick)` and `criteria(rows)`."""

from importlib import import_module

NAMES = (
    *("pendulums", "bodies", "layers", "turning", "kink", "conjugate", "large", "constraints"),
    *("units", "repeats", "pulses", "origins", "clocks", "threads", "random_systems", "rough"),
    *("ends", "energies", "windings", "forwards", "jumps", "sweeps"),
    *("closed", "billiards", "borders", "splines", "hidden", "normals", "barriers"),
)
FAMILIES = {name: import_module(f"{__name__}.{name}") for name in NAMES}
