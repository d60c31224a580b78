"""Pictures of a solution and of the principle behind it.

Every figure is a function of a solution: it takes axes or makes them, returns them, and shows
nothing. Next to it is a function that returns the arrays it draws.
"""

from actionopt.plot._bundle import Bundle, bundle, bundle_data
from actionopt.plot._energies import (
    Conserved,
    Energies,
    conserved,
    conserved_data,
    energies,
    energies_data,
)
from actionopt.plot._explore import Explorer, explore
from actionopt.plot._family import family, family_data, mesh, mesh_data
from actionopt.plot._fan import Fan, Fronts, fan, fan_data, fronts_data, wavefronts
from actionopt.plot._film import animation, film
from actionopt.plot._landscape import Landscape, landscape, landscape_data, landscapes
from actionopt.plot._motion import Motion, motion_data
from actionopt.plot._paths import Curves, curves, deviation, overview, paths, save
from actionopt.plot._relaxation import Panels, relaxation, relaxation_film
from actionopt.plot._slices import Slice, slice_data, slices
from actionopt.plot._spectrum import Spectrum, spectrum, spectrum_data
from actionopt.plot._strobe import motion
from actionopt.plot._style import SI, STYLE, Units, planar, symbol
from actionopt.plot._svg import svg
from actionopt.plot.data.relaxation import Relaxation, relaxation_data

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
    "Relaxation",
    "Slice",
    "Spectrum",
    "Units",
    "animation",
    "bundle",
    "bundle_data",
    "conserved",
    "conserved_data",
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
    "mesh",
    "mesh_data",
    "motion",
    "motion_data",
    "overview",
    "paths",
    "planar",
    "relaxation",
    "relaxation_data",
    "relaxation_film",
    "save",
    "slice_data",
    "slices",
    "spectrum",
    "spectrum_data",
    "svg",
    "symbol",
    "wavefronts",
]
