"""Safety: no sequence of events leaves a force on."""

import math
from typing import get_args

import hypothesis.strategies as st
import pytest
from hypothesis import given
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from dcdrw_control.sync.safety import RAMP_SECONDS, Fault, Limits, Safety, State

LIMITS = Limits(max_force=20.0, max_slew=2000.0, max_power=5.0)
FAULTS = get_args(Fault)


def active(limits: Limits = LIMITS) -> Safety:
    """A synchronizer that pushes with all it may."""
    safety = Safety(limits)
    for tick in range(200):
        safety.update(0.001 * tick, enabled=True, ready=True)
        safety.command(0.001 * tick, limits.max_force, 0.0)
    assert (safety.state, safety.force) == (State.ACTIVE, limits.max_force)
    return safety


def test_it_goes_from_disabled_to_armed_to_active_and_back():
    safety = Safety(LIMITS)
    assert safety.update(0.0, enabled=False, ready=True) is State.DISABLED
    assert safety.update(0.1, enabled=True, ready=False) is State.ARMED
    assert safety.update(0.2, enabled=True, ready=True) is State.ACTIVE
    safety.command(0.2, 5.0, 0.0)
    assert safety.command(0.3, 5.0, 0.0) == 5.0
    assert safety.update(0.4, enabled=False, ready=True) is State.RAMP_DOWN
    assert 0.0 <= safety.command(0.4 + RAMP_SECONDS, 5.0, 0.0) < 5.0
    assert safety.command(0.5 + RAMP_SECONDS, 5.0, 0.0) == 0.0
    assert safety.update(0.6, enabled=False, ready=True) is State.DISABLED


@pytest.mark.parametrize('fault', FAULTS)
def test_a_fault_takes_the_force_away_at_once_and_stays(fault):
    safety = active()
    safety.trip(fault)
    assert (safety.state, safety.reason, safety.command(1.0, 20.0, 0.0)) == (State.FAULT, fault, 0.0)
    assert safety.update(1.1, enabled=True, ready=True) is State.FAULT
    assert safety.update(1.2, enabled=False, ready=True) is State.FAULT


def test_after_a_fault_or_a_stop_enable_must_be_released_before_it_counts():
    for end in (lambda safety: safety.trip('stale'), lambda safety: safety.stop()):
        safety = active()
        end(safety)
        for tick in range(200):
            safety.command(1.0 + 0.001 * tick, 20.0, 0.0)
            safety.update(1.0 + 0.001 * tick, enabled=True, ready=True)
        safety.reset_fault()
        assert safety.update(2.0, enabled=True, ready=True) is State.DISABLED
        safety.update(2.1, enabled=False, ready=True)
        assert safety.update(2.2, enabled=True, ready=True) is State.ACTIVE


def test_power_is_limited_by_the_rate_of_the_coupler():
    safety = active()
    for rate in (0.5, -2.0, 100.0):
        assert abs(safety.command(1.0, 20.0, rate) * rate) <= LIMITS.max_power * (1 + 1e-12)


def test_force_changes_no_faster_than_allowed():
    safety = Safety(LIMITS)
    safety.update(0.0, enabled=True, ready=True)
    safety.command(0.0, 20.0, 0.0)
    assert safety.command(0.001, 20.0, 0.0) == pytest.approx(2.0)


class Anything(RuleBasedStateMachine):
    """Whatever happens, in whatever order."""

    def __init__(self) -> None:
        super().__init__()
        self.safety, self.now, self.left = Safety(LIMITS), 0.0, 0.0
        self.before = 0.0

    @rule(dt=st.floats(0.0, 0.2), enabled=st.booleans(), ready=st.booleans(), wanted=st.floats(), rate=st.floats())
    def tick(self, dt, enabled, ready, wanted, rate):
        self.now += dt
        self.safety.update(self.now, enabled, ready)
        if self.safety.state is State.ACTIVE:
            self.left = self.now
        self.before = self.safety.force
        force = self.safety.command(self.now, wanted, rate)
        assert abs(force) <= LIMITS.max_force
        # A force grows no faster than allowed; power and the end of it may take it away faster.
        assert abs(force) <= abs(self.before) + LIMITS.max_slew * dt + 1e-9
        if self.safety.state is State.ACTIVE and math.isfinite(rate) and rate:
            assert abs(force * rate) <= LIMITS.max_power * (1 + 1e-9)

    @rule(fault=st.sampled_from(FAULTS))
    def trip(self, fault):
        self.safety.trip(fault)

    @rule()
    def stop(self):
        self.safety.stop()

    @rule()
    def reset(self):
        self.safety.reset_fault()

    @invariant()
    def a_force_needs_active_or_the_ramp_after_it(self):
        if self.safety.force:
            assert self.safety.state in (State.ACTIVE, State.RAMP_DOWN)
            if self.safety.state is State.RAMP_DOWN:
                assert self.now - self.left <= RAMP_SECONDS + 0.2  # the last tick may be that far away

    @invariant()
    def a_fault_has_a_reason_and_nothing_else_has(self):
        assert (self.safety.state is State.FAULT) == (self.safety.reason is not None)


TestAnything = Anything.TestCase


@given(st.lists(st.floats(0.001, 0.02), min_size=10, max_size=60), st.floats(-30.0, 30.0))
def test_out_of_active_the_force_is_gone_within_100_ms(ticks, wanted):
    safety, now = active(), 1.0
    safety.command(now, wanted, 0.0)
    safety.stop()
    left = now
    for dt in ticks:
        now += dt
        safety.update(now, enabled=True, ready=True)
        force = safety.command(now, wanted, 0.0)
        if now - left >= 0.1:
            assert force == 0.0
