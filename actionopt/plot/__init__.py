"""Pictures of a solution and of the principle behind it.

Every figure is a function of a solution: it takes axes or makes them, returns them, and shows
nothing. Next to it is a function that returns the arrays it draws (`curves`, `..._data`).

A path: `overview`, `paths`, `motion`, `energies`, `conserved`, `deviation`, `contact`, `mesh`.
Several: `family`, `runs`, `fan`, `wavefronts`.
The action around a path: `bundle`, `slices`, `landscape`, `landscapes`, `spectrum`, `phasors`.
Moving: `film`, `animation`, `relaxation_film`; to drag: `page`, `explore`.
Files: `save`, `save_runs`, `svg`, `svgs`; names and units on axes: `Units`, `SI`; look: `STYLE`;
words in German or French: `with plot.language("de"):`.
"""

from actionopt.plot._energies import conserved, energies
from actionopt.plot._explore import Explorer, explore
from actionopt.plot._fan import fan, wavefronts
from actionopt.plot._files import save, save_runs, svg, svgs
from actionopt.plot._film import animation, film
from actionopt.plot._names import SI, UnitNames, planar, symbol
from actionopt.plot._paths import contact, deviation, family, mesh, overview, paths
from actionopt.plot._phasors import phasors
from actionopt.plot._relaxation import Panels, relaxation, relaxation_film
from actionopt.plot._runs import runs
from actionopt.plot._strobe import motion
from actionopt.plot._style import STYLE
from actionopt.plot._variations import bundle, landscape, landscapes, slices, spectrum
from actionopt.plot.data.along import (
    ConservedCurves,
    Curves,
    Energies,
    conserved_data,
    curves,
    energies_data,
    family_data,
    mesh_data,
)
from actionopt.plot.data.fan import Fan, Fronts, fan_data, fronts_data
from actionopt.plot.data.motion import Motion, motion_data
from actionopt.plot.data.phasors import Phasors, phasors_data
from actionopt.plot.data.relaxation import Relaxation, relaxation_data
from actionopt.plot.data.variations import (
    Bundle,
    Landscape,
    Slice,
    Spectrum,
    bundle_data,
    landscape_data,
    slice_data,
    spectrum_data,
)
from actionopt.plot.live import page
from actionopt.tools.words import language

# Their public names; each class has one name in the package.
Conserved, Units = ConservedCurves, UnitNames

__all__ = [
    "SI",
    "STYLE",
    "Bundle",
    "Conserved",
    "Curves",
    "Energies",
    "Explorer",
    "Fan",
    "Fronts",
    "Landscape",
    "Motion",
    "Panels",
    "Phasors",
    "Relaxation",
    "Slice",
    "Spectrum",
    "Units",
    "animation",
    "bundle",
    "bundle_data",
    "conserved",
    "conserved_data",
    "contact",
    "curves",
    "deviation",
    "energies",
    "energies_data",
    "explore",
    "family",
    "family_data",
    "fan",
    "fan_data",
    "film",
    "fronts_data",
    "landscape",
    "landscape_data",
    "landscapes",
    "language",
    "mesh",
    "mesh_data",
    "motion",
    "motion_data",
    "overview",
    "page",
    "paths",
    "phasors",
    "phasors_data",
    "planar",
    "relaxation",
    "relaxation_data",
    "relaxation_film",
    "runs",
    "save",
    "save_runs",
    "slice_data",
    "slices",
    "spectrum",
    "spectrum_data",
    "svg",
    "svgs",
    "symbol",
    "wavefronts",
]
