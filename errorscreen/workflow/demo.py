"""The study of the embedded example."""

from __future__ import annotations

from types import SimpleNamespace

from errorscreen.cases.case_models import CalibrationSection, DiscoverySection, RunSection, ScreeningSection
from errorscreen.cases.demo import demo_recordings
from errorscreen.simulators import PlantSimulator
from errorscreen.workflow.study import Study


def demo_study(seed: int, discovery: bool = True) -> Study:
    """Synchronous machine with eight hidden deviations that the seed draws; few epochs, so that it ends in minutes."""
    recording, held_out, truth = demo_recordings(seed)
    simulator = PlantSimulator("synchronous_machine", recording)
    sections = SimpleNamespace(
        screening=ScreeningSection(samples=600, epochs=25, top_k=4),
        calibration=CalibrationSection(),
        discovery=DiscoverySection(enabled=discovery),
        run=RunSection(),
    )
    return Study.of(
        f"Demo, seed {seed}: a synchronous machine", simulator, recording, held_out, sections, truth
    )
