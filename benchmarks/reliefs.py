"""More kinds of relief than the samples have: none that repeats, two on one body, stretched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sample_meshes.bodies import Body, FloatArray
from sample_meshes.details import DETAILS, Detail

_WAVES = 400
_TRANSITION = 2.0  # edge lengths over which one relief goes over into another
_STRETCH = 0.25  # of the length of a repeat, either way
_SWINGS = 3  # of the stretch along a body


def stochastic(shortest: float, longest: float, slope: float, seed: int) -> Detail:
    """Sum of waves of random directions and phases, of amplitudes ``wavelength ** slope``.

    Parameters
    ----------
    shortest, longest : float
        Wavelengths in mean edge lengths; the wavelength of a shape means nothing here.
    slope : float
    seed : int
    """

    def height(body: Body, _: float) -> FloatArray:
        chance = np.random.default_rng(seed)
        lengths = np.exp(chance.uniform(np.log(shortest), np.log(longest), _WAVES))
        directions = chance.normal(size=(_WAVES, 3))
        directions *= (2.0 * np.pi / lengths / np.linalg.norm(directions, axis=1))[:, None]
        phases = chance.uniform(0.0, 2.0 * np.pi, _WAVES)
        result = np.zeros(len(body.vertices))
        for length, direction, phase in zip(lengths, directions, phases, strict=True):
            result += length**slope * np.cos(body.vertices @ direction + phase)
        return result

    return Detail(wave=height, loose=True)


def beside(one: str, other: str) -> Detail:
    """Two details, one at each end of a body."""

    def height(body: Body, wavelength: float) -> FloatArray:
        chance = np.random.default_rng(0)
        first, second = (
            _unit(DETAILS[name].height(body, wavelength, chance)) for name in (one, other)
        )
        centred = body.vertices - body.vertices.mean(axis=0)
        along = centred[:, np.argmax(np.ptp(centred, axis=0))]
        share = 1.0 / (1.0 + np.exp(-along / _TRANSITION))
        return np.asarray(share * first + (1.0 - share) * second)

    return Detail(wave=height, loose=True)


def stretched(name: str) -> Detail:
    """Give a detail whose length changes along a body with a chart."""

    def height(body: Body, wavelength: float) -> FloatArray:
        if body.chart is None:
            msg = "this detail needs a body with a chart: torus, ring or capsule"
            raise ValueError(msg)
        chart = body.chart.copy()
        rate = 2.0 * np.pi * _SWINGS / (body.periods[0] or float(chart[:, 0].max()))
        chart[:, 0] += _STRETCH / rate * np.sin(rate * chart[:, 0])
        moved = replace(body, chart=chart)
        return DETAILS[name].height(moved, wavelength, np.random.default_rng(0))

    return Detail(wave=height, loose=True)


def _unit(height: FloatArray) -> FloatArray:
    centred = height - height.mean()
    return np.asarray(centred / max(float(np.sqrt((centred**2).mean())), 1e-12))


RELIEFS: dict[str, Detail] = {
    "rock": stochastic(4.0, 60.0, 1.0, 1),
    "stone": stochastic(4.0, 60.0, 1.0, 2),
    "clay": stochastic(6.0, 25.0, 0.5, 3),
    "plaster": stochastic(4.0, 40.0, 0.7, 4),
    "terrain": stochastic(4.0, 120.0, 1.3, 5),
    "scales_stretched": stretched("scales"),
}
DETAILS.update(RELIEFS)
PAIRS = (
    ("bumps", "clay"),
    ("honeycomb", "rock"),
    ("scales", "smooth"),
    ("woven", "grooves"),
    ("plates", "scales"),
    ("studs", "clay"),
    ("bricks", "plaster"),
)
DETAILS.update({f"{one}_beside_{other}": beside(one, other) for one, other in PAIRS})
