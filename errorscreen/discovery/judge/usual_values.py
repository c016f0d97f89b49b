r"""Evidence of effects whose strength has a usual value, such as a part that does not act at all.

Half of the prior of such a strength a lies at its usual value :math:`a_0`. With deviations in multiples of the scale,
their standard deviation :math:`\sigma_a` after the fit and s before it, the Savage-Dickey ratio (Dickey, *The Annals of
Mathematical Statistics* 42, 1971) of the value to a free strength, and the evidence, are

.. math::

    \ln B &= \ln\frac{s}{\sigma_a} - \frac{(a_0 - \hat a)^2}{2\sigma_a^2} + \frac{a_0^2}{2 s^2},\quad
    \ln Z_a = \ln Z + \ln\frac{1 + B}{2}                                                          \qquad (D8)

Without it a dead band that is wider than all that happened, any of which explains the same, would always be more
probable than a governor that is blocked.
"""

from __future__ import annotations

import numpy as np

from errorscreen.discovery.fits.hypotheses import PRIOR, Hypothesis


def usual_evidence(hypothesis: Hypothesis) -> float:
    """What usual values of its effects add to the logarithm of the evidence of a hypothesis, (D8); 0 without any."""
    total, space = 0.0, hypothesis.simulator.parameters
    for effect in hypothesis.effects:
        name = effect.local(effect.strength.name)
        if effect.usual is None or name not in hypothesis.names:
            continue
        j = hypothesis.names.index(name)
        sigma = float(np.sqrt(hypothesis.covariance[j, j]))
        if sigma > 0:  # not at a bound
            away = (effect.usual - float(hypothesis.theta[space.index(name)])) / float(
                space[name].scale or 1.0
            )
            usual = hypothesis.u[j] + away
            ratio = np.log(PRIOR / sigma) - 0.5 * (away / sigma) ** 2 + 0.5 * (usual / PRIOR) ** 2
            total += float(np.logaddexp(0.0, ratio) - np.log(2.0))
    return total
