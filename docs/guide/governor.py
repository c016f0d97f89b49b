"""A governor without limits: mechanical power that follows the speed, through one lag."""

from errorscreen.effects import Effect
from errorscreen.parameters import Parameter


def droop(value, omega, x, K, T):
    """T dx/dt = -K (omega - 1) - x, added to the mechanical power."""
    return value + x, (-K * (omega - 1.0) - x) / T


GOVERNOR = Effect(
    name="governor",
    title="Governor with droop",
    port="Pm",
    equations=droop,
    parameters=(
        Parameter("K", 20.0, 0.0, 50.0, "pu", "governor", "K", "power per speed deviation; 0 is no governor"),
        Parameter("T", 0.5, 0.1, 2.0, "s", "governor", "T", "time constant of servo and turbine"),
    ),
    states=("x",),
)
