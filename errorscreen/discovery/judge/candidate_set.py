"""Fitted hypotheses side by side: which of them leave only noise, and how evident each is."""

from __future__ import annotations

import logging
from collections.abc import Iterable

from errorscreen.discovery.fits.hypotheses import Hypothesis
from errorscreen.discovery.judge.residual_test import ResidualTest, residual_test
from errorscreen.discovery.judge.usual_values import usual_evidence
from errorscreen.effects.base import Effect

_log = logging.getLogger(__name__)

#: an effect adds nothing if the excess without it is less than a tenth larger
_LESS = 0.9


class CandidateSet:
    """Fitted hypotheses, one for each set of effects; one is *adequate* if its residuals pass for noise.
    By name: `residual_tests`, `scores` (logarithm of the evidence (D1) with `ResidualTest.excess` in place of χ²), and
    `signatures` (objective that each effect promised beside parameters alone).
    """

    def __init__(self, significance: float, seed: int) -> None:
        self.significance, self.seed = significance, seed
        self.hypotheses: list[Hypothesis] = []
        self.residual_tests: dict[str, ResidualTest] = {}
        self.scores: dict[str, float] = {}
        self.signatures: dict[str, float] = {}

    @property
    def base(self) -> Hypothesis:
        """The hypothesis without effects."""
        return next(h for h in self.hypotheses if not h.effects)

    @property
    def adequate(self) -> list[Hypothesis]:
        """Those that leave only noise, the most evident first."""
        found = [h for h in self.hypotheses if self.is_adequate(h)]
        return sorted(found, key=lambda h: -self.scores[h.name])

    def is_adequate(self, hypothesis: Hypothesis) -> bool:
        """Whether the residuals of a hypothesis pass for noise."""
        return self.passes(self.residual_tests[hypothesis.name])

    @property
    def most_effects(self) -> int:
        """Most effects of one of them."""
        return max(len(h.effects) for h in self.hypotheses)

    def with_effects(self, size: int) -> list[Hypothesis]:
        """Hypotheses with `size` effects."""
        return [h for h in self.hypotheses if len(h.effects) == size]

    def fit_of(self, effects: Iterable[Effect]) -> Hypothesis | None:
        """The one with just these effects, in any order."""
        return next((h for h in self.hypotheses if set(h.effects) == set(effects)), None)

    def nearest(self, size: int) -> Hypothesis | None:
        """The most evident hypothesis with `size` effects."""
        return max(self.with_effects(size), key=lambda h: self.scores[h.name], default=None)

    def beside(self, base: Hypothesis) -> list[Hypothesis]:
        """Those with one effect more than another one, the lowest first."""
        more = [h for h in self.hypotheses if len(h.effects) == len(base.effects) + 1]
        return sorted((h for h in more if set(h.effects) > set(base.effects)), key=lambda h: h.objective)

    def explained(self, size: int, share: float) -> bool:
        """Whether a hypothesis with `size` effects leaves less than this share of the excess of the parameters."""
        return any(self.leaves_less(h, share) for h in self.with_effects(size))

    def leaves_less(self, hypothesis: Hypothesis, share: float) -> bool:
        """Whether a hypothesis leaves less than this share of the excess of the parameters."""
        whole = self.residual_tests[self.base.name].excess
        return self.residual_tests[hypothesis.name].excess < share * whole

    @property
    def share_left(self) -> float:
        """Smallest share of the excess of the parameters that one of them leaves, at most 1."""
        whole = self.residual_tests[self.base.name].excess
        least = min(self.residual_tests[h.name].excess for h in self.hypotheses)
        return min(max(least / whole, 0.0), 1.0) if whole > 0 else 1.0

    def adds(self, hypothesis: Hypothesis) -> bool:
        """Whether each effect adds something: every fitted subset leaves notably more χ² beyond expected noise."""
        own = set(hypothesis.effects)
        fewer = (h for h in self.hypotheses if h.effects and set(h.effects) < own)
        left = hypothesis.chi2 - len(hypothesis.residuals)
        return all(left < _LESS * (h.chi2 - len(h.residuals)) for h in fewer)

    def passes(self, test: ResidualTest) -> bool:
        """Whether residuals pass for noise."""
        return test.p_value > self.significance

    def test(self, hypothesis: Hypothesis) -> ResidualTest:
        """Test whether the residuals of a hypothesis are noise."""
        return residual_test(
            hypothesis.observations,
            hypothesis.residuals,
            hypothesis.jacobian[:, hypothesis.free],
            levels=hypothesis.levels,
            random_state=self.seed,
        )

    def keep(self, hypothesis: Hypothesis, test: ResidualTest, instead: Hypothesis | None = None) -> None:
        """Add a hypothesis, or take it in place of another fit of the same one."""
        self.hypotheses = [h for h in self.hypotheses if h is not instead]
        self.hypotheses.append(hypothesis)
        self.residual_tests[hypothesis.name] = test
        # (D1) with the excess over noise in place of χ²
        of_noise = 0.5 * (hypothesis.chi2 - test.excess)
        self.scores[hypothesis.name] = hypothesis.evidence + of_noise + usual_evidence(hypothesis)
        values = hypothesis.name, hypothesis.chi2_per_sample, test.p_value
        _log.info("  %s: χ²/N %.3f, noise alone p = %.3f", *values)
