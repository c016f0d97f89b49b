"""Names what a model lacks, or says honestly that it is unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from errorscreen.calibration import MAPCalibrator
from errorscreen.calibration.problem import FitProblem
from errorscreen.discovery.diagnosis import Verdict, channel_fits, judge, noise_limit
from errorscreen.discovery.gain import Gain, measure_gain
from errorscreen.discovery.hypotheses import (
    PRIOR,
    Hypothesis,
    JointFit,
    Signature,
    linearised,
    parameters_only,
    signature,
)
from errorscreen.discovery.latent import Place, rank_places
from errorscreen.discovery.remainder import Remainder, remainder_test
from errorscreen.effects.base import Effect
from errorscreen.events import Event
from errorscreen.exceptions import InputError, SimulationError, check_integer, check_real, unknown_name
from errorscreen.observations import Observation
from errorscreen.sampling import generator
from errorscreen.simulators.base import Simulator
from errorscreen.simulators.observations import as_observations

#: prior probability that something is missing at all
_MISSING = 0.5
#: hypotheses at most so many times less probable than the best cannot be told from it
_ALIKE = 20.0
#: single effects to which a second one is added
_BEAM = 2
#: an effect that does not promise to lower the objective by this much is not fitted beside parameters that suffice
_WORTH = 4.0
#: effects with the best signatures, for each that is fitted to the end, whose joint fit begins
_TRIED = 2
#: starts that are followed and iterations at a time, starts that are kept after the first, times that those that got
#: furthest go on
_BEGUN, _FIRST, _KEPT, _SLICES = 3, 5, 2, 6
#: a joint fit goes on while its distance from the best is less than so many times what it gained last
_HOPE = 20.0
#: a fit whose χ²/N is at most this is tried with a step so many times smaller
_NEAR, _FINER = 50.0, 4
#: logarithm of the evidence by which an effect must beat parameters that leave nothing beyond noise: errors of size of
#: the noise that no one has modelled would otherwise be named
_MARGIN = 10.0
#: simulations of all parameters together, from which further starts of a single effect are taken
_MATCHES = 256

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cause:
    """One explanation of what the simulation gets wrong.

    Parameters
    ----------
    name : str
        Of the effect; several joined by `` + ``; ``"parameters"`` or ``"unknown"``.
    title : str
        For reports.
    kind : {"parameters", "effect", "measurement", "unknown"}
    probability : float
    place : str
        Port, or measured channel.
    parameters : dict of str to (float, float, float)
        Value and interval of each parameter of the effects.
    """

    name: str
    title: str
    kind: str
    probability: float
    place: str
    parameters: dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Group:
    """Explanations that these recordings cannot tell apart.

    Parameters
    ----------
    names : tuple of str
    separating : tuple of (str, str, float)
        Event, channel and by how many standard deviations of the noise (root of the sum of squares) the explanations
        would differ there, the best first; empty where no other event was given.
    """

    names: tuple[str, ...]
    separating: tuple[tuple[str, str, float], ...]


class CauseFinder(BaseEstimator):
    r"""Find what a simulator lacks to reproduce recordings.

    All hypotheses (parameters only, each effect of the library, pairs of them) are fitted together with all parameters.
    One is *adequate* if what it leaves passes the test for noise (`remainder_test`). Adequate ones are compared by
    their evidence; if there is none, the verdict is "unknown", with the place where something enters (`rank_places`).

    Parameters
    ----------
    simulator : Simulator
    effects : iterable of str, optional
        Names of the effects to try; all of the simulator's where not given.
    max_effects : int, default 2
        Largest number of effects that are named together.
    n_fits : int, default 6
        Effects whose joint fit goes on to the end: those that get furthest in a few iterations.
    n_draws : int, default 128
        Draws of an effect's parameters for its signature.
    significance : float, default 0.002
        What is left counts as more than noise where noise alone would be so conspicuous with this probability.
    n_starts, library_size : int
        Of the fit without effects, see `MAPCalibrator`.
    events : iterable of Event, optional
        Events that could be recorded in addition; the one that separates a group best is named.
    random_state : None, int, SeedSequence, Generator or RandomState
    report : callable, optional
        Takes lines of text while it works.

    Attributes
    ----------
    verdict_ : Verdict
        Its kind is ``"within-noise"``, ``"parameters"``, ``"effect"``, ``"measurement"`` or ``"unknown"``.
    causes_ : list of Cause
        The most probable first; probabilities sum to 1.
    groups_ : list of Group
    hypotheses_ : list of Hypothesis
        All that were fitted, by falling evidence, with `Remainder.excess` in place of χ².
    remainders_ : dict of str to Remainder
        Test of what each of them leaves, by its name.
    scores_ : dict of str to float
        Logarithm of the evidence of each hypothesis, (D1) with `Remainder.excess` in place of χ².
    signatures_ : dict of str to float
        Objective that each effect promised.
    places_ : list of Place
        Where an unknown signal would enter, the most probable first; empty unless the verdict is unknown.
    extended_simulator_ : Simulator
        The simulator with what was found, at its fitted values; without an effect the calibrated one.
    recalibrated_simulator_ : Simulator
        The simulator without effects at its fitted values.
    placebo_ : Hypothesis or None
        A wrong effect that was fitted, to compare a gain with.
    n_simulations_ : int

    Examples
    --------
    >>> from errorscreen.cases.demo import demo_recordings
    >>> from errorscreen.simulators import PlantSimulator
    >>> recording, held_out, truth = demo_recordings(0)
    >>> finder = CauseFinder(PlantSimulator("synchronous_machine", recording), random_state=0).fit(recording)
    >>> finder.verdict_.kind
    'parameters'
    """

    def __init__(
        self,
        simulator: Simulator,
        effects: Iterable[str] | None = None,
        *,
        max_effects: int = 2,
        n_fits: int = 6,
        n_draws: int = 128,
        significance: float = 0.002,
        n_starts: int = 4,
        library_size: int = 2048,
        events: Iterable[Event] | None = None,
        random_state: Any = None,
        report: Callable[[str], None] | None = None,
    ) -> None:
        self.simulator = simulator
        self.effects = effects
        self.max_effects = max_effects
        self.n_fits = n_fits
        self.n_draws = n_draws
        self.significance = significance
        self.n_starts = n_starts
        self.library_size = library_size
        self.events = events
        self.random_state = random_state
        self.report = report

    def fit(self, X: Any, y: None = None) -> CauseFinder:
        """Fit all hypotheses to one recording, or to several together.

        Parameters
        ----------
        X : Observation, or anything ``simulator.observe`` takes, or a list of them
        y : None
            Not used, present for scikit-learn.

        Raises
        ------
        InputError
            If an argument or a recording cannot be used.
        SimulationError
            If nothing can be simulated.
        """
        check_integer(self.max_effects, "max_effects", low=0)
        check_integer(self.n_fits, "n_fits")
        check_integer(self.n_draws, "n_draws")
        check_real(self.significance, "significance", low=0.0, high=1.0, above=True)
        observations = as_observations(self.simulator, X)
        candidates = self._candidates()
        self._count, self._seed = 0, int(generator(self.random_state).integers(2**31))
        self.hypotheses_: list[Hypothesis] = []
        self.remainders_: dict[str, Remainder] = {}
        self.signatures_: dict[str, float] = {}
        self.scores_: dict[str, float] = {}
        self.places_: list[Place] = []
        nominal = [self.simulator.baseline(o.event) for o in observations]
        base = self._base(observations)
        self._add(base)
        base = self._polish(base)
        if self.max_effects and not self._noise_at_nominal(observations, nominal):
            self._extend(base, observations, candidates, 1)
        self._eliminate()
        base = next(h for h in self.hypotheses_ if not h.effects)
        self._rank()
        self._judge(base, observations, nominal)
        self.n_simulations_ = self._count
        return self

    def predict(self, event: Any = None) -> _Array:
        """Response (R, L) of the extended simulator to an event, or to that of a recording."""
        check_is_fitted(self, "extended_simulator_")
        if event is not None and not isinstance(event, Event):
            event = as_observations(self.extended_simulator_, event)[0].event
        return self.extended_simulator_.baseline(event)

    def score(self, X: Any, y: None = None) -> float:
        """Negative χ²/N of the extended simulator over recordings; -inf if one cannot be simulated."""
        check_is_fitted(self, "extended_simulator_")
        problem = FitProblem(self.extended_simulator_, X)
        chi2 = float(problem.chi_square(self.extended_simulator_.parameters.nominal)[0])
        return -chi2 / problem.n_values if np.isfinite(chi2) else -np.inf

    @property
    def best_(self) -> Hypothesis:
        """The hypothesis that the verdict is about: the most probable one, or the parameters alone."""
        check_is_fitted(self, "extended_simulator_")
        return self._chosen

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False  # what is fitted is a recording
        tags.target_tags.required = False
        return tags

    def _candidates(self) -> list[Effect]:
        if not isinstance(self.simulator, Simulator):
            raise InputError(
                f"simulator is a {type(self.simulator).__name__}",
                allowed="an object of a subclass of Simulator",
            )
        library = {e.name: e for e in self.simulator.effects if e.kind != "latent"}
        if self.effects is None:
            return list(library.values())
        if isinstance(self.effects, str):
            raise InputError(f"effects is the text {self.effects!r}", allowed="a list of names of effects")
        for name in self.effects:
            if name not in library:
                raise unknown_name(name, library, kind="effect", where=repr(self.simulator))
        return [library[name] for name in self.effects]

    def _tell(self, line: str) -> None:
        if self.report is not None:
            self.report(line)

    def _base(self, observations: Sequence[Observation]) -> Hypothesis:
        """Only parameters deviate: from many starts, because a local minimum looks exactly like a missing effect."""
        self._tell("fit without effects")
        calibrator = MAPCalibrator(
            self.simulator,
            prior_scale=PRIOR,
            n_starts=self.n_starts,
            library_size=max(self.library_size, self.n_starts),
            random_state=self._seed,
        ).fit(list(observations))
        self._count += calibrator.n_simulations_
        self._calibrator = calibrator
        best = min(calibrator.starts_, key=lambda start: start["objective"])
        return parameters_only(self.simulator, observations, calibrator.theta_, best["state"])

    def _add(self, hypothesis: Hypothesis) -> Remainder:
        """Keep a hypothesis and test what it leaves."""
        remainder = remainder_test(
            hypothesis.observations,
            hypothesis.residuals,
            hypothesis.jacobian[:, hypothesis.free],
            random_state=self._seed,
        )
        self.hypotheses_.append(hypothesis)
        self.remainders_[hypothesis.name] = remainder
        # (D1) with the excess over noise in place of χ²
        self.scores_[hypothesis.name] = hypothesis.evidence + 0.5 * (hypothesis.chi2 - remainder.excess)
        self._tell(
            f"  {hypothesis.name}: χ²/N {hypothesis.chi2_per_sample:.3f}, noise alone p = {remainder.p_value:.3f}"
        )
        return remainder

    def _adequate(self, hypothesis: Hypothesis) -> bool:
        return self.remainders_[hypothesis.name].p_value > self.significance

    def _noise_at_nominal(self, observations: Sequence[Observation], nominal: Sequence[_Array]) -> bool:
        z = np.concatenate([o.deviations(y)[o.mask] for o, y in zip(observations, nominal, strict=True)])
        self._nominal = remainder_test(observations, z, random_state=self._seed)
        return self._nominal.p_value > self.significance

    def _extend(
        self, base: Hypothesis, observations: Sequence[Observation], candidates: Sequence[Effect], depth: int
    ) -> None:
        """Add one effect to a hypothesis, and another to the best of these where none is adequate."""
        tried = {effect.name for effect in base.effects}
        others = [effect for effect in candidates if effect.name not in tried]
        self._tell(f"signatures of {len(others)} effects beside {base.name}")
        signatures = self._signatures(base, observations, others)
        self._tell(f"joint fits of {min(len(signatures), _TRIED * self.n_fits)} of them")
        fitted = self._compete(base, signatures[: _TRIED * self.n_fits])
        if fitted and not any(map(self._adequate, self.hypotheses_)):
            best = min(range(len(fitted)), key=lambda i: fitted[i].objective)
            fitted[best] = self._polish(fitted[best])
        if depth < self.max_effects and not any(map(self._adequate, self.hypotheses_)):
            fitted.sort(key=lambda h: -h.evidence)
            for hypothesis in fitted[:_BEAM]:
                self._extend(hypothesis, observations, candidates, depth + 1)
                if any(map(self._adequate, self.hypotheses_)):
                    break

    def _polish(self, hypothesis: Hypothesis) -> Hypothesis:
        """Fit a hypothesis that comes near to noise further, with a smaller step and the noise that belongs to it.

        What it leaves may be the error of the integration, or noise of the injected signals that passes through the
        model with its effects otherwise than through the nominal one. If that makes it adequate, all others that come
        near are treated in the same way, so that evidences stay comparable.
        """
        if self._adequate(hypothesis) or hypothesis.chi2_per_sample > _NEAR:
            return hypothesis
        simulator = hypothesis.simulator.refined(_FINER)
        observations = [simulator.quantified(o, hypothesis.theta) for o in hypothesis.observations]
        finer = self._finer(hypothesis, observations)
        if finer is None:
            return hypothesis
        self._replace(hypothesis, finer)
        if self._adequate(finer):
            for other in list(self.hypotheses_):
                if other is not finer and other.chi2_per_sample < _NEAR:
                    better = self._finer(other, observations)
                    if better is not None:
                        self._replace(other, better)
        return finer

    def _finer(self, hypothesis: Hypothesis, observations: Sequence[Observation]) -> Hypothesis | None:
        """The same hypothesis fitted with a smaller step to observations of another uncertainty; None if that fails."""
        simulator = hypothesis.simulator
        if simulator.settings().get("step") == self.simulator.settings().get("step"):
            simulator = simulator.refined(_FINER)
        problem = FitProblem(simulator, list(observations), hypothesis.names)
        try:
            return JointFit(hypothesis.effects, problem, hypothesis.u).run(_FIRST * 2).hypothesis()
        except SimulationError:
            return None
        finally:
            self._count += problem.n_simulations

    def _replace(self, old: Hypothesis | None, new: Hypothesis) -> None:
        """Take a better fit of the same hypothesis."""
        self.hypotheses_ = [h for h in self.hypotheses_ if h is not old]
        self._add(new)

    def _eliminate(self) -> None:
        """Fit the best adequate hypothesis without each of its effects.

        Forward selection may have started wrongly; and a fit without effects that was stuck in a local minimum looks
        exactly like a missing effect, so it is tried again from where the effect has led.
        """
        adequate = [h for h in self.hypotheses_ if self._adequate(h)]
        if not adequate or not max(adequate, key=lambda h: self.scores_[h.name]).effects:
            return
        best = max(adequate, key=lambda h: self.scores_[h.name])
        for dropped in best.effects:
            effects = tuple(e for e in best.effects if e is not dropped)
            simulator = self.simulator
            if best.simulator.settings().get("step") != simulator.settings().get("step"):
                simulator = simulator.refined(_FINER)  # as the best one was
            for effect in effects:
                simulator = simulator.extend(effect)
            problem = FitProblem(simulator, list(best.observations))
            keep = [j for j, name in enumerate(best.names) if name in problem.names]
            order = [best.names[j] for j in keep]
            u = best.u[keep][[order.index(name) for name in problem.names]]
            hypothesis = JointFit(effects, problem, u).run(_FIRST * _SLICES).hypothesis()
            self._count += problem.n_simulations
            before = next((h for h in self.hypotheses_ if set(h.effects) == set(effects)), None)
            if before is None or hypothesis.objective < before.objective:
                self._replace(before, hypothesis)

    def _compete(self, base: Hypothesis, signatures: Sequence[Signature]) -> list[Hypothesis]:
        """Fit effects for a few iterations each and those that get furthest to the end."""
        threshold = base.objective - _WORTH if self._adequate(base) else np.inf
        known = {frozenset(e.name for e in h.effects) for h in self.hypotheses_}
        fits = []
        for found in signatures:
            effects = (*base.effects, found.effect)
            if found.objective > threshold or frozenset(e.name for e in effects) in known:
                continue
            try:
                fits.append(
                    JointFit(effects, found.problem, found.starts).keep(_BEGUN).run(_FIRST).keep(_KEPT)
                )
            except SimulationError:
                self._count += found.problem.n_simulations
        fits.sort(key=lambda fit: fit.objective)
        self._count += sum(fit.problem.n_simulations for fit in fits[self.n_fits :])
        fits = fits[: self.n_fits]
        running = list(fits)
        for _ in range(_SLICES):
            running = [fit.run(_FIRST) for fit in running if fit.active]
            # one that has come to rest far above the best will not catch up
            best = min((fit.objective for fit in fits), default=0.0)
            running = [fit for fit in running if fit.objective - best < _HOPE * max(fit.gained, 1.0)]
        done = []
        for fit in fits:
            hypothesis = fit.hypothesis()
            self._count += fit.problem.n_simulations
            self._add(hypothesis)
            done.append(hypothesis)
        return done

    def _signatures(
        self, base: Hypothesis, observations: Sequence[Observation], effects: Sequence[Effect]
    ) -> list[Signature]:
        """Signatures at the fitted values and at the nominal ones, the most promising first."""
        simulator = base.simulator
        points = [(base.u, base.jacobian)]
        problem = FitProblem(simulator, list(observations))
        if not base.effects:  # with an effect the nominal values of its parameters mean nothing
            zero = np.zeros(len(base.u))
            points.append((zero, linearised(problem, zero)[1]))
        self._count += problem.n_simulations
        found = []
        for number, effect in enumerate(effects):
            seed = np.random.SeedSequence(self._seed, spawn_key=(number, len(base.effects)))
            matches = 0 if base.effects else _MATCHES
            one = signature(simulator, observations, effect, points, self.n_draws, seed, matches)
            if one is not None:
                found.append(one)
                if not base.effects:
                    self.signatures_[effect.name] = one.objective
        return sorted(found, key=lambda s: s.objective)

    def _rank(self) -> None:
        """Probabilities of the adequate hypotheses and of "unknown"."""
        self.hypotheses_.sort(key=lambda h: -self.scores_[h.name])
        adequate = [h for h in self.hypotheses_ if self._adequate(h)]
        base = next(h for h in self.hypotheses_ if not h.effects)
        lead = max((self.scores_[h.name] for h in adequate), default=-np.inf) - self.scores_[base.name]
        if base not in adequate and adequate and lead < _MARGIN:
            adequate.append(base)  # a conspicuous cell, but nothing that an effect explains better
        tried = max(1, len(self.signatures_))
        suffice = any(not h.effects for h in adequate)
        logs = []
        for h in adequate:
            prior = 1.0 - _MISSING if not h.effects else _MISSING / tried ** len(h.effects)
            logs.append(self.scores_[h.name] + np.log(prior) - (_MARGIN if suffice and h.effects else 0.0))
        # what nobody has thought of, the more probable the less what is left looks like noise
        weights = np.exp(np.array(logs) - max(logs)) if logs else np.zeros(0)
        if logs:
            p = max(self.remainders_[adequate[int(np.argmax(logs))].name].p_value, self.significance)
            weights = np.append(weights, weights.sum() * self.significance / p)
        else:
            weights = np.ones(1)
        weights /= weights.sum()
        causes = [self._cause(h, float(w)) for h, w in zip(adequate, weights, strict=False)]
        causes.append(Cause("unknown", "Unknown", "unknown", float(weights[-1]), "", {}))
        self.causes_ = sorted(causes, key=lambda c: -c.probability)

    def _cause(self, hypothesis: Hypothesis, probability: float) -> Cause:
        effects = hypothesis.effects
        kinds = {effect.kind for effect in effects}
        kind = "parameters" if not effects else "measurement" if kinds == {"measurement"} else "effect"
        return Cause(
            hypothesis.name,
            " and ".join(e.title for e in effects) or "Parameters of the model",
            kind,
            probability,
            ", ".join(e.place for e in effects),
            {e.local(n): v for e in effects for n, v in hypothesis.parameters_of(e).items()},
        )

    def _judge(
        self, base: Hypothesis, observations: Sequence[Observation], nominal: Sequence[_Array]
    ) -> None:
        """Verdict, groups and the extended simulator."""
        by_name = {h.name: h for h in self.hypotheses_}
        first = self.causes_[0]
        self._chosen = by_name.get(first.name, base)
        self.groups_ = []
        explained = [
            c for c in self.causes_ if c.name in by_name and c.probability * _ALIKE >= first.probability
        ]
        if first.kind in ("effect", "measurement") and len(explained) > 1:
            members = [by_name[c.name] for c in explained]
            self.groups_ = [Group(tuple(c.name for c in explained), self._separating(members))]
        self.recalibrated_simulator_ = self.simulator.with_nominal(base.theta)
        self.placebo_ = self._placebo()
        self.extended_simulator_ = self._chosen.simulator.with_nominal(self._chosen.theta)
        self.verdict_ = self._verdict(base, observations, nominal)

    def _placebo(self) -> Hypothesis | None:
        """Fitted hypothesis with one wrong effect: at least as many parameters as what was chosen, if there is one."""
        used = {e.name for h in self.hypotheses_ if self._adequate(h) for e in h.effects}
        chosen = sum(len(e.parameters) for e in self._chosen.effects)
        wrong = [h for h in self.hypotheses_ if len(h.effects) == 1 and h.effects[0].name not in used]
        if not self._chosen.effects or not wrong:
            return None
        return max(wrong, key=lambda h: (min(len(h.effects[0].parameters), chosen), h.evidence))

    def measure_gain(self, held_out: Any) -> Gain:
        """Gain of the extended simulator on recordings that were not fitted; an extension without gain is withdrawn.

        The placebo is the best fitted wrong effect with as many parameters.

        Parameters
        ----------
        held_out : Observation, or anything ``simulator.observe`` takes, or a list of them

        Returns
        -------
        Gain
            If its interval does not exclude zero, or the placebo gains more, the verdict becomes "unknown" and
            `extended_simulator_` the recalibrated one.
        """
        check_is_fitted(self, "extended_simulator_")
        placebo = self.placebo_
        gain = measure_gain(
            self.simulator,
            self.recalibrated_simulator_,
            self.extended_simulator_,
            held_out,
            placebo=None if placebo is None else placebo.simulator.with_nominal(placebo.theta),
            random_state=self._seed,
        )
        if self.verdict_.kind in ("effect", "measurement") and not gain.holds:
            low, high = gain.interval
            self.extended_simulator_ = self.recalibrated_simulator_
            self.verdict_ = Verdict(
                "unknown",
                f"{self.causes_[0].title} explains what was fitted but gains nothing on recordings that were not: "
                f"{gain.gain:.2f} [{low:.2f}, {high:.2f}] of the squared error"
                + ("" if gain.placebo is None else f", a placebo {gain.placebo:.2f}")
                + ". The extension is withdrawn.",
            )
        return gain

    def _separating(self, members: Sequence[Hypothesis]) -> tuple[tuple[str, str, float], ...]:
        """Events and channels in which the two most probable members differ most."""
        found = []
        reference = members[0].observations[0]
        for event in self.events or ():
            try:
                a, b = (member.predict(event) for member in members[:2])
            except SimulationError:
                continue
            for r, channel in enumerate(reference.channels):
                distance = float(np.sqrt(np.sum((a[r] - b[r]) ** 2)) / reference.noise[r])
                found.append((event.name, channel, distance))
        return tuple(sorted(found, key=lambda item: -item[2]))

    def _verdict(
        self, base: Hypothesis, observations: Sequence[Observation], nominal: Sequence[_Array]
    ) -> Verdict:
        first = self.causes_[0]
        limit = noise_limit(observations, nominal)
        figures = (
            f"χ²/N is {base.chi2_per_sample:.3g} with parameters alone, {self._chosen.chi2_per_sample:.3g} with what "
            f"was chosen; noise explains up to {limit:.3g}."
        )
        if self._nominal.p_value > self.significance and first.kind in ("parameters", "unknown"):
            return judge(observations, nominal, self._calibrator)
        if first.kind == "parameters":
            return judge(observations, nominal, self._calibrator)
        if first.kind in ("effect", "measurement"):
            alike = (
                f" These recordings cannot tell it from: {', '.join(self.groups_[0].names[1:])}."
                if self.groups_
                else ""
            )
            return Verdict(
                first.kind,
                f"{first.title} (at {first.place}) explains what parameters cannot, with probability "
                f"{first.probability:.2f}. {figures}{alike}",
            )
        return self._unknown(base, observations, figures)

    def _unknown(self, base: Hypothesis, observations: Sequence[Observation], figures: str) -> Verdict:
        self._tell("places of an unknown signal")
        self.places_, count = rank_places(base, observations)
        self._count += count
        where = ""
        if self.places_:
            place = self.places_[0]
            where = (
                f" A signal that enters at {place.place} of the {place.device} would explain it best "
                f"({place.text})."
            )
        best = self.hypotheses_[0]
        doubt = ""
        if not base.converged:
            doubt = (
                " The search without effects did not end at a minimum, so that other values of the parameters may do "
                "better: allow more starts, or narrow the bounds."
            )
        return Verdict(
            "unknown",
            f"Neither parameters nor any effect of the library leave only noise; the closest, {best.name}, leaves χ²/N "
            f"{best.chi2_per_sample:.3g}. {figures}{where}{doubt}",
        )


def nominal_fits(simulator: Simulator, observations: Sequence[Observation]) -> list[Any]:
    """Figures of each channel of each recording at the nominal parameters, see `channel_fits`."""
    return [fit for o in observations for fit in channel_fits(o, simulator.baseline(o.event))]
