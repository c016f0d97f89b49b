"""A study: one model, its recordings, and the sections of the case file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from errorscreen._runtime.files import sha256
from errorscreen._runtime.registry import other_packages
from errorscreen._runtime.store import digest, program
from errorscreen.cases import Case
from errorscreen.cases.case_models import CalibrationSection, DiscoverySection, RunSection, ScreeningSection
from errorscreen.cases.limits_section import LimitsSection
from errorscreen.cases.model_sections import DeviceSection
from errorscreen.data.observations import Observation
from errorscreen.data.recordings import Recording
from errorscreen.data.resampling import check_steps
from errorscreen.discovery.search_step import search_simulator
from errorscreen.exceptions import InputError, MissingExtraError
from errorscreen.learning.regressors import require_network
from errorscreen.models import Device
from errorscreen.models.dyr import DyrFile
from errorscreen.models.unit import MACHINE_BASE
from errorscreen.report.result import Role
from errorscreen.screening import SCREENERS
from errorscreen.simulators import Connection, PlantSimulator
from errorscreen.simulators.base import Simulator
from errorscreen.workflow.grid_recordings import observed_grid
from errorscreen.workflow.suspect_readings import observed

Stage = Literal["screening", "calibration", "diagnosis"]


class ModelFile(NamedTuple):
    """A unit in a model file of the user's."""

    file: DyrFile
    bus: int | str | None
    id: int | str | None


@dataclass(frozen=True)
class Study:
    """One model, its recordings, and how they are compared.

    Parameters
    ----------
    title : str
    simulator : Simulator
    observation : Observation
        The first recording, which is fitted and screened.
    held_out : tuple of Observation
        Recordings that are only judged on.
    base_mva, f_nominal : float
        1 pu of P and Q in MVA, and the nominal frequency in Hz.
    screening, calibration, discovery, run
        Sections of a case file.
    truth : mapping of str to float, optional
        Hidden parameters, where they are known (the demo).
    paths : tuple of str
        Files of the recordings in the order of `observations`; empty where there are none.
    together : tuple of Observation
        Recordings that are fitted together with `observation`; screening and the swarm do not use them.
    model_file : ModelFile, optional
        Where the model comes from a file.
    typical : str
        Sentence on values that are not those of this unit.
    limits : LimitsSection, optional
        That the model is validated by.
    digests : tuple of str
        SHA-256 of the files in `paths`.
    notes : tuple of str
        What was left out, for the advice of the report.
    """

    title: str
    simulator: Simulator
    observation: Observation
    held_out: tuple[Observation, ...]
    base_mva: float
    f_nominal: float
    screening: ScreeningSection
    calibration: CalibrationSection
    discovery: DiscoverySection
    run: RunSection
    truth: Mapping[str, float] | None = None
    paths: tuple[str, ...] = ()
    together: tuple[Observation, ...] = ()
    model_file: ModelFile | None = None
    typical: str = ""
    limits: LimitsSection | None = None
    digests: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def searched(self) -> tuple[Observation, ...]:
        """Fitted recordings: the first one and those together with it."""
        return (self.observation, *self.together)

    @property
    def observations(self) -> tuple[Observation, ...]:
        """All recordings: fitted ones, then held-out ones."""
        return (*self.searched, *self.held_out)

    @property
    def roles(self) -> tuple[Role, ...]:
        """Use of each of `observations`."""
        further: list[Role] = ["together" for _ in self.together]
        further += ["held_out" for _ in self.held_out]
        return ("fit", *further)

    @classmethod
    def from_case(cls, case: Case) -> Study:
        """Read the recordings of a case file and set up its simulator.

        Raises
        ------
        InputError
            If a recording cannot be used, or lacks what the device needs.
        """
        recording, held_out = case.load_recording(), case.load_held_out()
        together = case.load_together()
        recordings = (recording, *together, *held_out)
        for one in recordings:
            steps = {
                "simulation.step": case.simulation.step,
                "simulation.dt": case.simulation.dt,
                "discovery.step": case.discovery.step,
            }
            for key, seconds in steps.items():
                if seconds is not None:
                    check_steps(one.time[-1] - one.time[0], seconds, f"recording {one.name!r}, {key}")
        further: tuple[Recording | Observation, ...] = recordings[1:]
        first: Recording | Observation = recording
        simulator: Simulator
        told: tuple[str, ...] = ()
        if case.grid is not None:
            case.check_events()
            simulator, (first, *others) = observed_grid(case, case.grid, recordings)
            further = tuple(others)
        else:
            assert case.device is not None  # `load_case` sees to that
            device = case.device.model(case.folder, case.steps)
            constants, connection, told = _between(case, case.device, device)
            simulator = PlantSimulator(
                device,
                recording,
                parameters=case.parameters(),
                constants=constants,
                step=case.simulation.step,
                dt=case.simulation.dt,
                grid_impedance=case.device.grid_impedance,
                imposed=case.device.imposed,
                constant_frequency=case.device.constant_frequency,
                angle_reactance=case.device.angle_reactance,
                connection=connection,
            )
        check_effects(simulator, case.discovery, case.source)
        n = len(together)
        study = cls.of(case.title, simulator, recording, further[n:], case, together=further[:n])
        if isinstance(first, Observation):  # of a grid, beside what happened in it
            study = replace(study, observation=first)
        file = None if case.device is None else case.device.file(case.folder)
        if case.device is not None and file is not None:
            study = replace(study, model_file=ModelFile(file, case.device.bus, case.device.id))
        study = replace(
            study,
            paths=tuple(section.path for section in case.recordings.values()),
            digests=tuple(sha256(case.folder / section.path) for section in case.recordings.values()),
            typical="" if case.device is None else case.device.typical,
            limits=case.limits,
        )
        allowed, seconds = case.simulation.model_error, case.simulation.model_error_time

        def as_stated(one: Observation) -> Observation:
            one = replace(one, assumptions=(*one.assumptions, *told))
            return one.with_model_error(allowed, seconds) if allowed else one

        return study._each(as_stated)

    @classmethod
    def of(
        cls,
        title: str,
        simulator: Simulator,
        recording: Recording,
        held_out: tuple[Recording | Observation, ...],
        sections: Any,
        truth: Mapping[str, float] | None = None,
        together: tuple[Recording | Observation, ...] = (),
    ) -> Study:
        """Study of recordings that are at hand; `sections` has screening, calibration, discovery and run.

        Raises
        ------
        InputError
            If a recording lacks what the simulator needs, two have the same name or hold the same readings, or an
            effect is unknown.
        """
        check_effects(simulator, sections.discovery)
        screening, notes = usable_screening(sections.screening)
        observation, *others = (observed(simulator, r) for r in (recording, *together, *held_out))
        study = cls(
            title or recording.name,
            simulator,
            observation,
            tuple(others[len(together) :]),
            recording.base_mva,
            recording.f_nominal,
            screening,
            sections.calibration,
            sections.discovery,
            sections.run,
            truth,
            together=tuple(others[: len(together)]),
            notes=notes,
        )
        _check_distinct(study)
        if study.discovery.step is not None:  # told now, not after all that comes before the search
            search_simulator(simulator, study.discovery.step, study.observations)
        return study

    def _each(self, change: Callable[[Observation], Observation]) -> Study:
        """The same with each observation changed."""
        together, held_out = (tuple(map(change, ones)) for ones in (self.together, self.held_out))
        return replace(self, observation=change(self.observation), together=together, held_out=held_out)

    def fingerprint(self, stage: Stage, *more: Any) -> str:
        """Digest of all that a stage depends on, so that a change of anything else leaves it valid.

        Parameters
        ----------
        stage : {"screening", "calibration", "diagnosis"}
        *more : object
            Dependencies beside the model, the first recording and the stage's section: other recordings, and results
            of earlier stages.
        """
        base = self.calibration.model_dump(include={"starts", "library", "level"})
        sections: dict[Stage, dict[str, Any]] = {  # the list of methods changes nothing in each of them
            "screening": self.screening.model_dump(exclude={"methods"}),
            "calibration": self.calibration.model_dump(exclude={"methods", "prior_scale", *base}),
            "diagnosis": {**self.discovery.model_dump(exclude={"first_look"}), **base},
        }
        return digest(
            program(),
            other_packages(),
            stage,
            [(p.name, p.nominal, p.lower, p.upper, p.scale) for p in self.simulator.parameters],
            repr(self.simulator),
            self.simulator.settings(),
            self.observation,
            sections[stage],
            self.run.random_state,
            list(more),
        )


def _between(
    case: Case, section: DeviceSection, device: Device
) -> tuple[dict[str, float], Connection | None, tuple[str, ...]]:
    """Constants of the device, its connection to the recorded point, and assumptions about that."""
    if case.plant is None:
        return section.constants, None, ()
    constants, connection, told = section.constants, case.plant.connection, []
    if (network := case.network()) is not None:
        connection = network.connection
        constants, differences = network.constants_with(constants)
        told = [*network.notes, *differences]
        if MACHINE_BASE in device.constant_values():
            constants = {MACHINE_BASE: network.base_mva / len(network.units), **constants}
    if "with plant_control" in device.tags:
        told.append(
            "The plant controller measures at the terminal of the unit, not at the recorded point, whatever bus its "
            "record names."
        )
    return constants, connection, tuple(told)


def usable_screening(section: ScreeningSection) -> tuple[ScreeningSection, tuple[str, ...]]:
    """The section without methods that train a network, where torch is missing and nobody asked for them by name."""
    trained = [name for name in section.methods if SCREENERS[name].trains]
    try:
        require_network()
    except MissingExtraError as error:
        if trained and "methods" not in section.model_fields_set:
            others = [name for name in section.methods if name not in trained]
            note = f"Parameters were ranked without {', '.join(trained)}: {error}"
            return section.model_copy(update={"methods": others}), (note,)
    return section, ()


def check_effects(simulator: Simulator, section: DiscoverySection, source: str = "") -> None:
    """Refuse unknown names of effects before hours of screening; `source` is the case file, for the message."""
    try:
        simulator.effects_named(section.effects)
    except InputError as error:
        where = ", ".join(part for part in (source, "discovery.effects") if part)
        raise InputError(error.what, where=where, allowed=error.allowed, remedy=error.remedy) from None


def _check_distinct(study: Study) -> None:
    """Refuse a recording that is given twice, and equal names, by which event effects are switched."""
    seen: dict[str, str] = {}
    names: set[str] = set()
    for observation, role in zip(study.observations, study.roles, strict=True):
        name, key = observation.event.name, digest(observation.values)
        where = f"recording {name!r}" + ("" if role == "fit" else f" in [[{role}]]")
        if key in seen:
            raise InputError(
                f"it holds the same readings as {seen[key]}",
                where=where,
                allowed="another event in each recording",
                remedy="Judge on recordings that are not fitted, or leave this one out",
            )
        if name in names:
            raise InputError(
                "another recording has the same name",
                where=where,
                allowed="a name of its own for each recording",
                remedy="Give one of them another name (key name)",
            )
        seen[key] = where
        names.add(name)
