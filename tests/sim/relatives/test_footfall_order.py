import pytest
from hypothesis import example, given, settings

from dcdrw_sim.model.presets import preset
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ends import FORWARD, Strike
from dcdrw_sim.motion.trajectory import run
from dcdrw_sim.relatives.footfall_order import FEET, Contact, contacts, order, rear_lead, steady_contacts
from tests.sim.rigs import between

quick = settings(deadline=None)
PAPER = preset('paper').resolved()


def strike(wheel, t):
    return Strike(wheel, t, None, FORWARD)


def test_half_a_step_makes_the_four_beat_walk():
    falls = [contact for contact in steady_contacts(0.5) if contact.start >= 0.0]
    assert order(falls) == '1-4-2-3'
    assert [contact.start for contact in falls] == pytest.approx([0.0, 0.25, 0.5, 0.75])
    assert rear_lead(0.5) == 0.25


@quick
@given(between(0.001, 0.999))
def test_every_phase_between_keeps_the_order(phase):
    assert order(steady_contacts(phase, 2)) == '1-4-2-3'


@quick
@given(between(0.0, 0.999))
def test_a_rear_foot_leads_the_front_foot_of_its_side(phase):
    falls = {
        (contact.foot, round(contact.start - phase / 2 * (contact.foot > 2), 6)): contact.start
        for contact in steady_contacts(phase, 2)
    }
    assert falls[1, 1.0] - falls[3, 0.5] == pytest.approx(rear_lead(phase))
    assert falls[2, 0.5] - falls[4, 0.0] == pytest.approx(rear_lead(phase))


def test_strikes_at_once_make_a_trot_and_nearly_a_step_apart_a_pace():
    assert order(steady_contacts(0.0)) == '1+4-2+3'
    assert {FEET[foot] for foot in (1, 4)} == {'front left', 'rear right'}  # a diagonal
    assert order(steady_contacts(1.0 - 1e-9)) == '1-4+2-3'
    assert {FEET[foot] for foot in (4, 2)} == {'rear right', 'front right'}  # a side
    assert rear_lead(0.0) == 0.5
    assert rear_lead(1.0) == 0.0


@quick
@given(between(0.0, 0.999), between(0.01, 1.99))
@example(0.02, 0.01)
def test_one_front_and_one_rear_foot_are_always_on_the_ground(phase, time):
    standing = [contact.foot for contact in steady_contacts(phase, 2) if contact.start <= time < contact.end]
    assert sorted(foot > 2 for foot in standing) == [False, True]


def test_a_walk_of_the_coupled_pair_is_the_four_beat_walk():
    result = run(*start(PAPER, 0.3), seconds=12.0)
    found = contacts(result.strikes, result.duration)
    assert order(found) == '1-4-2-3'
    assert len(found) == len(result.strikes)
    assert found[-1].end == result.duration


def test_feet_of_a_wheel_take_turns_from_strike_to_strike():
    found = contacts([strike(2, 0.1), strike(1, 0.2), strike(2, 0.3), strike(1, 0.4), strike(2, 0.5)], 0.6)
    assert found == [
        Contact(3, 0.1, 0.3),
        Contact(1, 0.2, 0.4),
        Contact(4, 0.3, 0.5),
        Contact(2, 0.4, 0.6),
        Contact(3, 0.5, 0.6),
    ]


def test_a_slipped_step_turns_the_sequence_round():
    steady = [strike(1, 1.0), strike(2, 1.5), strike(1, 2.0), strike(2, 2.5)]
    slipped = [
        strike(1, 3.0),
        strike(1, 4.0),
        strike(2, 4.5),
        strike(1, 5.0),
        strike(2, 5.5),
        strike(1, 6.0),
        strike(2, 6.5),
    ]
    assert order(contacts(steady, 3.0)) == '1-4-2-3'
    assert order(contacts(steady + slipped, 7.0)) == '1-3-2-4'


def test_without_a_whole_stride_there_is_no_order():
    assert order([]) == ''
    assert order(contacts([strike(1, 0.0), strike(2, 0.3)], 1.0)) == ''


@pytest.mark.parametrize('phase', [-0.1, 1.0, float('nan')])
def test_impossible_phase_is_refused(phase):
    with pytest.raises(ValueError, match='phase must be in'):
        steady_contacts(phase)
