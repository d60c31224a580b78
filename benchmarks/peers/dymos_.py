"""dymos: a phase without controls, Radau transcription, scipy's SLSQP as its examples have it.

The right-hand side is a vectorised component with the derivatives derived by hand.
"""

from __future__ import annotations

import dymos as dm  # type: ignore[import-not-found]
import numpy as np
import openmdao.api as om  # type: ignore[import-not-found]

from benchmarks.arithmetic import NUMPY
from benchmarks.peers._peer import Answer, Failed, Peer, piecewise, waypoints
from benchmarks.problems import Case, Ends

MESHES = ((5, 3), (10, 3), (5, 9), (10, 9))


def component(case: Case):
    """Return the class of the equations of motion."""
    n = case.n

    class Motion(om.ExplicitComponent):
        def initialize(self):
            self.options.declare("num_nodes", types=int)

        def setup(self):
            nn = self.options["num_nodes"]
            self.add_input("t", np.zeros(nn))
            self.add_input("q", np.zeros((nn, n)))
            self.add_input("v", np.zeros((nn, n)))
            self.add_output("a", np.zeros((nn, n)))
            k, i, j = np.meshgrid(np.arange(nn), np.arange(n), np.arange(n), indexing="ij")
            rows, cols = (k * n + i).ravel(), (k * n + j).ravel()
            for name in ("q", "v"):
                self.declare_partials("a", name, rows=rows, cols=cols)

        def compute(self, inputs, outputs):
            outputs["a"] = case.acceleration(inputs["q"].T, inputs["v"].T, inputs["t"], NUMPY).T

        def compute_partials(self, inputs, partials):
            both = case.partials(inputs["q"].T, inputs["v"].T, inputs["t"])
            for name, A in zip(("q", "v"), both, strict=True):
                partials["a", name] = np.moveaxis(A, -1, 0).ravel()

    return Motion


def build(case: Case, mesh):
    """Return the OpenMDAO problem and its phase."""
    segments, order = mesh
    p = om.Problem(reports=False)
    p.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-12, maxiter=500, disp=False)
    p.driver.declare_coloring(show_summary=False)
    phase = dm.Phase(
        ode_class=component(case),
        transcription=dm.Radau(num_segments=segments, order=order, compressed=True),
    )
    trajectory = dm.Trajectory()
    trajectory.add_phase("phase", phase)
    p.model.add_subsystem("trajectory", trajectory)
    phase.set_time_options(fix_initial=True, fix_duration=True, targets=["t"])
    shape = (case.n,)
    phase.add_state(
        "q", fix_initial=True, fix_final=True, rate_source="v", targets=["q"], shape=shape
    )
    phase.add_state("v", rate_source="a", targets=["v"], shape=shape)
    phase.add_objective("time", loc="final")
    p.setup()
    return p, phase


def _solve(p, phase, case: Case, ends: Ends, knots, q, v, mesh) -> Answer:
    phase.set_time_val(initial=0.0, duration=case.duration)
    phase.set_state_val("q", q.T, time_vals=knots)
    phase.set_state_val("v", v.T, time_vals=knots)
    # Interpolation may round the ends.
    if p.run_driver().success is False:
        raise Failed("SLSQP did not converge")
    t = p.get_val("trajectory.phase.timeseries.time").ravel()
    keep = np.append(np.diff(t) > 1e-12 * case.duration, True)
    t = t[keep]
    q, v = (p.get_val(f"trajectory.phase.timeseries.{x}")[keep].T for x in "qv")
    return Answer(lambda times: piecewise(t, q, mesh[1], times), (p, phase, t, q, v))


def cold(case: Case, ends: Ends, start: str, mesh) -> Answer:
    """Set up the problem and run the driver."""
    p, phase = build(case, mesh)
    knots = np.linspace(0.0, case.duration, 33)
    return _solve(p, phase, case, ends, knots, *waypoints(case, ends, start, knots), mesh)


def again(answer: Answer, case: Case, ends: Ends, mesh) -> Answer:
    """Run the driver again from the last solution with its ends moved."""
    p, phase, t, q, v = answer.state
    s = t / case.duration
    q = q + np.outer(ends.start - q[:, 0], 1 - s) + np.outer(ends.end - q[:, -1], s)
    return _solve(p, phase, case, ends, t, q, v, mesh)


PEER = Peer(("dymos", "openmdao"), MESHES, cold, again)
