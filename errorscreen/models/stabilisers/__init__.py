"""Power system stabilisers, one file a model."""

from errorscreen.models.part import Part

STABILISERS: tuple[Part, ...] = ()
