"""Problems of one coordinate, and the projectile: closed forms known."""

from __future__ import annotations

import numpy as np

from actionopt import scenes
from actionopt.scenes import oscillating_wall, oscillator, pendulum, projectile
from benchmarks.problems._case import Case, along, no_partials, sample_times


def of_scene(module, first: dict, other: dict, *, name="", title="", **rest) -> Case:
    """Return the case of a scene of the package at two sets of end points."""
    called = module.__name__.rsplit(".", 1)[1]
    scene, again = scenes.get(called, **first), scenes.get(called, **other)
    problem = scene.problem
    T = problem.duration
    return Case(
        name=name or called,
        title=title or called.replace("_", " "),
        lagrangian=module.lagrangian,
        coordinates=problem.system.coordinates,
        parameters=problem.parameters,
        constraint=getattr(module, "constraint", None),
        duration=T,
        ends=lambda: (along(scene.exact, sample_times(T)), along(again.exact, sample_times(T))),
        **rest,
    )


def _layer(eps: float = 1e-3) -> Case:
    def lagrangian(q, v, t, *, eps):
        return eps**2 * v[0] ** 2 / 2 + q[0] ** 2 / 2

    def exact(a, b):
        # (a sinh((1 - t)/eps) + b sinh(t/eps)) / sinh(1/eps), without overflow
        return lambda t: (a * np.exp(-t / eps) + b * np.exp((t - 1) / eps))[None]

    times = sample_times(1.0, 20 * eps)
    return Case(
        name="layer",
        title=f"linear layer, eps = {eps:g}",
        lagrangian=lagrangian,
        coordinates=("q",),
        parameters={"eps": eps},
        acceleration=lambda q, v, t, x: q / eps**2,
        partials=lambda q, v, t: (no_partials(q) + eps**-2, no_partials(q)),
        duration=1.0,
        ends=lambda: (along(exact(1.0, 1.0), times), along(exact(0.7, 1.2), times)),
        layer=20 * eps,
        time_unit=eps,
    )


def _oscillator(name: str, duration: float) -> Case:
    return of_scene(
        oscillator,
        {"duration": duration},
        {"duration": duration, "start": 0.8, "end": -0.4},
        name=name,
        title=f"oscillator, T = {duration:g}",
        acceleration=lambda q, v, t, x: -1.0 * q,
        partials=lambda q, v, t: (no_partials(q) - 1.0, no_partials(q)),
    )


def cases() -> list[Case]:
    """Return the cases of this file."""
    return [
        of_scene(
            projectile,
            {},
            {"end": (2.5, -1.0)},
            acceleration=lambda q, v, t, x: np.stack([0 * v[0], 0 * v[1] - 9.81]),
            partials=lambda q, v, t: (no_partials(q), no_partials(q)),
        ),
        _oscillator("oscillator", 2.5),
        _oscillator("oscillator_long", 10.0),
        of_scene(
            pendulum,
            {},
            {"amplitude": 1.1, "since": 0.2},
            acceleration=lambda q, v, t, x: -9.81 * x.sin(q),
            partials=lambda q, v, t: (-9.81 * np.cos(q)[None], no_partials(q)),
        ),
        of_scene(
            oscillating_wall,
            {},
            {"start": 0.3, "end": 0.2},
            acceleration=lambda q, v, t, x: -4.0 * q + 0.3 * 9.0 * x.cos(3.0 * t),
            partials=lambda q, v, t: (no_partials(q) - 4.0, no_partials(q)),
        ),
        _layer(),
    ]
