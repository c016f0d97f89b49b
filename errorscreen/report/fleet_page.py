"""One page over many cases: what was found in each, and where its report lies."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from errorscreen.report.first_screen import certainty, model_to_use, statement
from errorscreen.report.html_report import template
from errorscreen.report.result import Result

#: verdicts in the order of the page, those that need a person first
_ORDER = ("not run", "unknown", "nearest", "measurement", "effect", "parameters", "within-noise")
#: size of a small picture in pixels, and the largest error over noise that it shows
_WIDTH, _HEIGHT, _MOST = 120, 30, 1000.0


@dataclass(frozen=True)
class FleetRow:
    """One case.

    Parameters
    ----------
    name : str
        Of its folder.
    case : str
        Path of the case file.
    code : int
        Exit code of its run.
    result : Result, optional
        None where it did not go through.
    message : str
        Why it did not.
    """

    name: str
    case: str
    code: int
    result: Result | None = None
    message: str = ""

    @property
    def verdict(self) -> str:
        """Kind of the verdict; "not run" where there is none."""
        return self.result.diagnosis.final.kind if self.result else "not run"

    @property
    def title(self) -> str:
        """Of the study."""
        return self.result.study.title if self.result else self.name

    @property
    def link(self) -> str:
        """Address of the report, from the page."""
        return f"{quote(self.name)}/report.html"

    @property
    def statement(self) -> str:
        """The answer in words, or why there is none."""
        return statement(self.result) if self.result else self.message

    @property
    def certainty(self) -> str:
        """How sure the answer is."""
        return certainty(self.result) if self.result else ""

    @property
    def limits(self) -> str:
        """What the limits say."""
        return self.result.validation.summary() if self.result and self.result.validation else ""

    @property
    def suspects(self) -> int:
        """Number of doubts about the readings."""
        return len(self.result.hints) if self.result else 0

    @property
    def change(self) -> float:
        """Error after over that before, root mean square in multiples of the noise, so that channels of any unit count
        alike; NaN without both.
        """
        after = model_to_use(self.result) if self.result else None
        if self.result is None or after is None:
            return math.nan
        pairs = [
            (one.chi2_per_sample, other.chi2_per_sample)
            for one in self.result.models[0].channels
            if (other := after.channel(one.recording, one.channel)) and math.isfinite(other.chi2_per_sample)
        ]
        before = sum(old for old, _ in pairs)
        return math.sqrt(sum(new for _, new in pairs) / before) if before else math.nan

    @property
    def bars(self) -> list[tuple[float, float, float, str]]:
        """Bars of the small picture: left, height, width and kind, the error over noise of each stage and channel."""
        if self.result is None:
            return []
        first = self.result.recordings[0].name
        old = [one for one in self.result.models[0].stages if one.recording == first]
        new = model_to_use(self.result)
        found, step = [], _WIDTH / max(len(old), 1)
        for k, one in enumerate(old):
            other = new.stage(one.recording, one.channel, one.stage) if new else None
            pair = (("before", one), ("after", other))
            for n, (kind, stage) in enumerate(pair):
                if stage is not None and math.isfinite(stage.rms_over_noise):
                    share = math.log10(max(min(stage.rms_over_noise, _MOST), 1.0)) / math.log10(_MOST)
                    found.append(((k + 0.45 * n) * step, 1.0 + share * (_HEIGHT - 1), 0.4 * step, kind))
        return found


def render_fleet(rows: Sequence[FleetRow]) -> str:
    """Text of the page; the cases that need a person come first, else in the order given."""
    ordered = sorted(rows, key=lambda row: _ORDER.index(row.verdict))
    counts = Counter(row.verdict for row in rows)
    return template("index.html.j2").render(
        rows=ordered,
        counts=[(kind, counts[kind]) for kind in _ORDER if counts[kind]],
        width=_WIDTH,
        height=_HEIGHT,
    )
