r"""Phase-locked loop with another gain: a converter that follows the angle of the grid more slowly, or faster.

.. math:: \dot\vartheta = \frac{K_{PLL}}{1 + s}\,\frac{V_q}{V},\quad
    \Delta f = \frac{\dot\vartheta}{2\pi f_0}                                                   \qquad (J1)

with the loop of (W2) and (T2): s = 1 halves its gain, s = -0.5 doubles it.
"""

from __future__ import annotations

from typing import Any

from errorscreen.effects.base import Effect, strength


def slower_loop(value: Any, df: Any, s: Any) -> Any:
    """Derivative of the angle and measured frequency deviation of the loop, (J1)."""
    return value / (1.0 + s), df / (1.0 + s)


PHASE_LOCKED_LOOP = Effect(
    name="pll",
    title="Slower or faster phase-locked loop",
    port="d_theta",
    devices=("dfig_plant",),
    equations=slower_loop,
    parameters=(
        strength("s", 2.0, 14.0, "", "phase-locked loop", "s", "gain K_PLL / (1 + s); 0: as modelled", -0.6),
    ),
    beside=("df",),
    formula="dϑ/dt = K_PLL / (1 + s) · Vq / V, Δf = dϑ/dt / (2π f0)",
    description="The converter's loop has another gain than the model's. A slow one sees jumps of the angle late, and "
    "as a smaller and longer deviation of frequency, to which inertia and frequency control answer; in a grid its "
    "current lies at a wrong angle until it has caught up, which exchanges active for reactive power. A fast one does "
    "the opposite.",
    source="Clark, Miller, Sanchez-Gasca, Modeling of GE Wind Turbine-Generators for Grid Studies, v4.5, 2010",
    confused_with=(
        "another low-pass of the frequency",
        "another gain of the virtual inertia",
        "a lag in the control of active current",
    ),
)
