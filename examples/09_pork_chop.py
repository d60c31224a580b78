"""When to leave for Mars: paths over a grid of days, and the speed that each pair of days asks.

The action S of the path between two events is a function of them, and its derivatives are the
momenta there. So the paths over the days of departure and of arrival are a map of the speeds with
which a ship leaves the Earth and meets Mars, a "pork-chop plot". Each is solved from its
neighbours. There are two maps, for there are two ways round the Sun.

The planets move on ellipses by Kepler's equation (elements of 2000, Standish of JPL), whose small
inclination is left out: with it a ridge would part the map where Mars is opposite the departure.
Kepler's equation checks every path, too: the ellipse on which the ship sets out meets Mars.

Expect: all paths solved, in one piece each way round; ships at Mars to nine digits; the slowest
departure at about 3 km/s in the autumn of 2026. Takes a second; `python examples/09_pork_chop.py
300` draws 300 x 300 days and takes a minute.
"""

import datetime
import sys

import numpy as np

import actionopt as ao

mu = 4 * np.pi**2  # of the Sun, AU^3/yr^2
KM_S = 4.74047  # km/s in one AU/yr
# Semi-major axis (AU), eccentricity, mean longitude in 2000, its change a century, perihelion.
EARTH = 1.00000, 0.01671, 100.4646, 35999.3724, 102.9377
MARS = 1.52371, 0.09339, -4.5534, 19140.3027, -23.9436
LEAVE, ARRIVE = (2026.65, 2027.05), (2027.35, 2028.0)
WAYS = "with the planets", "the other way round"


def lagrangian(q, v, t):
    """T - V of a unit mass, in polar coordinates."""
    return (v[0] ** 2 + (q[0] * v[1]) ** 2) / 2 + mu / q[0]


ship = ao.System(lagrangian, ["r", "phi"], name="transfer")


def ellipse(a, e, M):
    """Return distance and angle from perihelion at mean anomalies M: Kepler's equation."""
    E = M + e * np.sin(M)
    for _ in range(50):
        E = E - (E - e * np.sin(E) - M) / (1 - e * np.cos(E))
    b = e / (1 + np.sqrt(1 - e**2))
    return a * (1 - e * np.cos(E)), E + 2 * np.arctan(b * np.sin(E) / (1 - b * np.cos(E)))


def planet(elements, year):
    """Return distance, angle, and the velocities along and across the radius."""
    a, e, longitude, rate, perihelion = elements
    M = np.radians(longitude + rate * (year - 2000) / 100 - perihelion)
    r, angle = ellipse(a, e, M)
    h = np.sqrt(mu * a * (1 - e**2))
    return r, angle + np.radians(perihelion), mu / h * e * np.sin(angle), h / r


def transfers(count, way):
    """Return the paths over count x count days, departure by departure, to and fro.

    And the planets there. The ends move with the times, so all that varies is zipped.
    """
    leave, arrive = np.linspace(*LEAVE, count), np.linspace(*ARRIVE, count)
    t0, t1 = np.repeat(leave, count), np.tile(arrive, (count, 1))
    t1[1::2] = t1[1::2, ::-1]
    t1 = t1.ravel()
    earth, mars = planet(EARTH, t0), planet(MARS, t1)
    phi0 = earth[1] - 26 * 2 * np.pi  # turns since 2000
    phi1 = phi0 + np.mod(mars[1] - phi0, 2 * np.pi) - 2 * np.pi * way
    over = {
        "t0": t0,
        "t1": t1,
        ("start", "r"): earth[0],
        ("start", "phi"): phi0,
        ("end", "r"): mars[0],
        ("end", "phi"): phi1,
    }
    start = ao.Event(t0[0], [earth[0][0], phi0[0]])
    end = ao.Event(t1[0], [mars[0][0], phi1[0]])
    return ao.sweep(ao.Problem(ship, start, end), over, zip=True), (earth, mars)


def excess(runs, planets):
    """Return the speeds of departure and of arrival relative to the planets, km/s."""
    found = []
    for k, (r, _, along, across) in enumerate(planets):
        p = runs.momenta[:, k]
        found.append(KM_S * np.hypot(p[:, 0] - along, p[:, 1] / r - across))
    return found


def misses(runs):
    """Return how far from Mars the ellipses are on which ships set out, AU."""
    (r, phi), (u, h) = runs.ends[:, 0].T, runs.momenta[:, 0].T
    a = 1 / (2 / r - (u**2 + (h / r) ** 2) / mu)
    x, y = 1 - r / a, r * u / np.sqrt(mu * a)  # e cos(E), e sin(E)
    e, M = np.hypot(x, y), np.arctan2(y, x) - y
    over = dict(zip(runs.grid.names, runs.grid.values, strict=True))
    first = ellipse(a, e, M)[1]
    r1, last = ellipse(a, e, M + np.sqrt(mu / a**3) * (over["t1"] - over["t0"]))
    (r2, phi2), turn = runs.ends[:, 1].T, np.sign(h) * (last - first)
    return np.abs(r1 * np.exp(1j * (phi + turn)) - r2 * np.exp(1j * phi2))


def day(year):
    """Return the date and time of a year with a fraction."""
    return datetime.datetime(2000, 1, 1) + datetime.timedelta(days=365.25 * (year - 2000))


count = 25
maps = [transfers(count, way) for way in (0, 1)]


def visualize(maps=maps):
    """Draw the speeds of departure over the days, both ways round the Sun."""
    from matplotlib import dates, pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.8), sharey=True, layout="constrained")
    levels = [3.1, 3.5, 4, 5, 6, 8, 10, 12, 15], [50, 52, 54, 56, 58, 60, 61, 61.5]
    for ax, name, some, (runs, planets) in zip(axes, WAYS, levels, maps, strict=True):
        count = round(np.sqrt(runs.action.size))
        x, y = ([day(t) for t in np.linspace(*row, count)] for row in (LEAVE, ARRIVE))
        speed, turn = excess(runs, planets)[0], np.degrees(np.abs(np.diff(runs.ends[..., 1])))
        rows = np.stack([speed, turn[:, 0]]).reshape(2, count, count)
        rows[:, 1::2] = rows[:, 1::2, ::-1]
        lines = ax.contour(x, y, rows[0].T, some, colors="C0")
        ax.clabel(lines, fmt="%g")
        half = ax.contour(x, y, rows[1].T, [180], colors="grey", linestyles="dashed")
        ax.clabel(half, fmt="half round")
        best = runs.grid.at(int(np.nanargmin(speed)))
        ax.plot(day(best["t0"]), day(best["t1"]), "o", color="black", clip_on=False)
        ax.set(title=f"{name}: {np.nanmin(speed):.1f} km/s and more", xlabel="departure")
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(dates.DateFormatter("%b %Y"))
            axis.set_major_locator(dates.MonthLocator())
    axes[0].set_ylabel("arrival at Mars")
    figure.suptitle("speed relative to the Earth at departure, km/s")
    return axes


if __name__ == "__main__":
    if len(sys.argv) > 1:
        maps = [transfers(int(sys.argv[1]), way) for way in (0, 1)]
    for name, (runs, planets) in zip(WAYS, maps, strict=True):
        speed = excess(runs, planets)[0]
        best = int(np.nanargmin(speed))
        t0, t1 = (day(runs.grid.at(best)[t]).date() for t in ("t0", "t1"))
        print(f"{name}: {runs}")
        print(f"  slowest departure {speed[best]:.2f} km/s on {t0}, arrival {t1}")
        print(f"  ellipses miss Mars by {np.nanmax(misses(runs)):.1e} AU at most")

    from matplotlib import pyplot

    visualize(maps)
    pyplot.show()
