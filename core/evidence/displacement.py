"""The rigid shift of a built element against its plan, with an honest covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from .blocks import Blocks, block_means
from .error_model import ErrorModel
from .robust_fit import fit_agreeing, normal_matrix
from .sightings import Sightings
from .unevenness import Unevenness

Array = NDArray[np.float64]

LEAST_SHARE = 0.05
"""A direction is determined when at least this share of the evidence lies on faces across it."""
LEAST_ACROSS = 3.0
"""... and at least this many blocks' worth of it, so that their agreement shows how far they can be trusted."""
ROUGHER = 0.95
"""An element is rougher than the campaign when its blocks scatter more than this share of such elements would."""


@dataclass(frozen=True)
class Shift:
    """Shift in the directions that the scan determines; zero in the others. Metres."""

    vector: Array
    """(3,)"""
    covariance: Array
    """(3, 3) of measurement and unevenness; zero in directions that are not determined."""
    registration: Array
    """(3, 3) per unit variance of a station's position: multiply by sigma_registration^2."""
    determined: Array
    """(K, 3) orthonormal rows, K = 0 ... 3."""
    residual_sigma: float
    """Spread of the block means about the shift: unevenness and local deviation."""

    def plus(self, start: Array) -> Shift:
        """The same found from ``start`` (3,): the shift as a whole, still only in the determined directions."""
        along = self.determined.T @ (self.determined @ start) if len(self.determined) else start
        return Shift(self.vector + along, self.covariance, self.registration, self.determined, self.residual_sigma)


NOTHING = Shift(np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((0, 3)), 0.0)


def fit_shift(sightings: Sightings, errors: ErrorModel) -> Shift:
    """Robust least squares of n.t = residual over block means, from sightings of the element's own surface.

    Each return counts once, with its exact distance from the face that its ray meets. The covariance of the shift t = G d
    is G (N + U) G^T: N is the variance of the block means from the scatter of their returns, U the unevenness that blocks of
    one face share over a distance, whatever the station, as estimated from the whole campaign. An element whose blocks
    scatter more than that gets its own, larger one. The registration part is kept apart, since stations are shared.
    """
    if len(sightings) == 0:
        return NOTHING
    blocks = block_means(sightings, errors.sigma, errors.body)
    n, d, size = blocks.normal, blocks.residual, np.minimum(blocks.count, 25.0)
    share = (n * (size / size.sum())[:, None]).T @ n
    eigenvalue, axes = np.linalg.eigh(share)
    across = ((n @ axes) ** 2).sum(axis=0)
    basis = axes[:, (eigenvalue >= LEAST_SHARE) & (across >= LEAST_ACROSS)].T
    if not len(basis):
        return NOTHING
    basis, shift, robust, uneven2 = fit_agreeing(n, d, blocks.variance, errors.unevenness.variance, basis)
    if not len(basis):
        return NOTHING
    a = n @ basis.T
    weight = robust / (blocks.variance + uneven2)
    gain = np.linalg.solve(normal_matrix(a, weight), (a * weight[:, None]).T)
    covariance = (gain * blocks.variance) @ gain.T + _unevenness(blocks, gain, d - a @ shift, robust, errors.unevenness)
    registration = np.zeros((len(basis), len(basis)))
    for station in np.unique(blocks.station):
        of = blocks.station == station
        lever = gain[:, of] @ n[of]
        registration += lever @ lever.T
    return Shift(
        basis.T @ shift, basis.T @ covariance @ basis, basis.T @ registration @ basis, basis, float(np.sqrt(uneven2))
    )


def _unevenness(blocks: Blocks, gain: Array, residual: Array, robust: Array, campaign: Unevenness) -> Array:
    """(K, K) what unevenness adds: the campaign's, scaled up where the element's own blocks scatter significantly more.

    Where the campaign shows none, or an element is rougher, its blocks' squares about the shift are what is known of it;
    their scatter is that of few pieces, so Student's factor widens it.
    """
    shared, pieces = campaign.shared(blocks, gain)
    freedom = min(max(float(robust.sum()) - len(gain), 1.0), max(pieces - len(gain), 1.0))
    stated = blocks.variance + campaign.variance
    ratio = float(np.sum(robust * residual**2 / stated) / max(float(robust.sum()) - len(gain), 1.0))
    if ratio <= float(chdtri(freedom, 1.0 - ROUGHER)) / freedom:
        return shared
    widening = (float(stdtrit(freedom, 0.975)) / 1.96) ** 2
    own = (gain * (robust * residual**2)) @ gain.T
    return np.asarray(widening * np.maximum(ratio, 1.0) * shared if campaign.variance > 0 else widening * own)
