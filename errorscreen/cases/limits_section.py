"""Section of a case file for limits that a model is validated by."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from pydantic import model_validator

from errorscreen.cases.section import NameIn, NotNegative, Positive, Section, setting
from errorscreen.exceptions import InputError
from errorscreen.validation import PROFILES, Limits, WindowLimits


class WindowLimitsSection(Section):
    """Largest errors in one window of a recording."""

    ME: Positive | None = setting(None, "of the mean error, in pu")
    MAE: Positive | None = setting(None, "of the mean absolute error, in pu")
    MXE: Positive | None = setting(None, "of the largest absolute error, in pu")


class LimitsSection(Section):
    """Limits that the model is validated by; without them errors are told and not judged."""

    profile: Annotated[str, NameIn(PROFILES)] | None = setting(None, "limits from public text")
    source: str = setting("", "where limits of your own come from")
    set_by: str = setting("", "who set them for this unit")
    before: WindowLimitsSection = setting(WindowLimitsSection(), "in the second before the event")
    during: WindowLimitsSection = setting(WindowLimitsSection(), "during the fault")
    after: WindowLimitsSection = setting(WindowLimitsSection(), "after it, or after a step")
    leave_out_begin: NotNegative | None = setting(
        None,
        "s after the beginning that do not count; 0.14 without a profile, as IEC 61400-27-2 lets at most",
    )
    leave_out_end: NotNegative | None = setting(
        None, "s after the end of a fault that do not count; 0.5 without a profile"
    )
    times: Positive | None = setting(
        None, "steps: largest difference of reaction, rise and settling time, as a part of the measured one"
    )
    overshoot: Positive | None = setting(None, "steps: the same of the overshoot")
    steady: Positive | None = setting(None, "steps: largest difference of the final level, in pu")

    @property
    def title(self) -> str:
        """Of the limits, for the report; empty where there are none."""
        if self.profile is not None:
            return PROFILES.find(self.profile).title
        return self.source

    def limits(self) -> Limits | None:
        """The profile with the user's own limits in place of its; None where nothing is stated."""
        stated = self.model_dump(exclude_unset=True)
        if not stated:
            return None
        found = Limits(self.source) if self.profile is None else PROFILES.find(self.profile).limits
        own = {
            name: WindowLimits(**getattr(self, name).model_dump()) for name in ("before", "during", "after")
        }
        known = {name: found.windows.get(name, WindowLimits()) for name in own}
        merged = {
            name: WindowLimits(
                *(
                    getattr(one, m) if getattr(one, m) is not None else getattr(known[name], m)
                    for m in ("ME", "MAE", "MXE")
                )
            )
            for name, one in own.items()
        }
        changed: dict[str, Any] = {"begin": self.leave_out_begin, "end": self.leave_out_end}
        changed |= {name: getattr(self, name) for name in ("times", "overshoot", "steady")}
        source = "; changed by: ".join(filter(None, dict.fromkeys([found.source, self.source])))
        return replace(
            found,
            windows=merged,
            set_by=self.set_by,
            source=source,
            **{name: value for name, value in changed.items() if value is not None},
        )

    @model_validator(mode="after")
    def _with_source(self) -> LimitsSection:
        own = self.model_fields_set - {"profile", "source", "set_by"}
        if own and not self.source:
            raise InputError(
                f"limits of your own ({', '.join(sorted(own))}) have no source",
                allowed="the document that they come from, as source",
            )
        return self
