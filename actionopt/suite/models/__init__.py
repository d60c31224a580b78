"""Test problems written down as they are: models of mechanics whose answers are proven.

They are not discrete actions: what solver writers ask for beside those. `actionopt.suite.model`
makes one by its name.
"""

from __future__ import annotations

from collections.abc import Callable

from actionopt.suite.models import (
    control,
    fields,
    fits,
    flips,
    floors,
    friction,
    goddard,
    infeasible,
    slides,
    small,
    supports,
)
from actionopt.suite.models.model import Model

MODELS: dict[str, Callable[..., Model]] = {
    make.__name__: make
    for make in (
        infeasible.chain_too_short,
        infeasible.bump_too_high,
        infeasible.arm_in_disc,
        floors.string_above_floor,
        fits.decaying_oscillations,
        small.brachistochrone,
        small.ritz_oscillator,
        small.shooting,
        fields.torsion,
        fields.membrane,
        fields.soap_film,
        control.double_integrator,
        control.singular_arc,
        goddard.goddard_rocket,
        slides.slide_above_floor,
        supports.beam_on_supports,
        friction.blocks_by_hand,
        flips.pendulum_row,
    )
}
