"""The plan of the search: its steps can be left out, and each tells what it cost and gained."""

import pytest

from errorscreen.discovery import CauseFinder
from errorscreen.discovery.search.plan import PLAN, STEPS, check_plan
from errorscreen.exceptions import InputError


def fitted(spring, **options):
    simulator, observation = spring
    return CauseFinder(simulator, max_effects=1, n_draws=32, random_state=0, **options).fit(observation)


@pytest.fixture(scope="module")
def whole(spring):
    return fitted(spring)


def test_every_step_is_described_once():
    assert len(set(STEPS)) == len(STEPS)
    assert all(step.when and step.what for step in PLAN)
    assert all(step.inside in ("", "any step", *STEPS) for step in PLAN)


def test_steps_tell_what_they_cost_and_gained(whole):
    rows = {row.name: row for row in whole.plan_report_}
    assert set(rows) >= {step.name for step in PLAN if not step.inside}
    assert 0 < sum(row.simulations for row in rows.values()) <= whole.n_simulations_
    assert all(row.simulations >= 0 and row.seconds >= 0 for row in rows.values())
    assert rows["add effects"].left < 0.1
    assert rows["add effects"].adequate >= 1
    assert whole.diagnosis_.plan == whole.plan_report_


def test_a_plan_is_the_same_whoever_orders_it(spring, whole):
    again = fitted(spring, plan=list(reversed(STEPS)))
    assert again.n_simulations_ == whole.n_simulations_
    assert [cause.name for cause in again.causes_] == [cause.name for cause in whole.causes_]


@pytest.mark.parametrize("left_out", ["leave local minima", "drop effects"])
def test_a_step_that_is_left_out_does_not_run(spring, whole, left_out):
    found = fitted(spring, plan=[step for step in STEPS if step != left_out])
    assert left_out not in {row.name for row in found.plan_report_}
    assert found.n_simulations_ <= whole.n_simulations_
    assert found.causes_[0].name == whole.causes_[0].name  # an easy case needs none of them


def test_a_plan_without_any_effect_leaves_the_cause_unknown(spring):
    found = fitted(spring, plan=[])
    assert found.verdict_.kind == "unknown"
    assert [h.name for h in found.hypotheses_] == ["parameters"]
    assert found.plan_report_ == ()


@pytest.mark.parametrize(
    ("plan", "message"),
    [(["drop efects"], "'drop efects'.*'drop effects'"), ("drop effects", "plan is a text")],
)
def test_what_is_no_plan_is_refused(spring, plan, message):
    with pytest.raises(InputError, match=message):
        fitted(spring, plan=plan)
    with pytest.raises(InputError, match=message):
        check_plan(plan)
