"""Least squares over samples: what made a trial is found again, with honest errors, whatever spoils some samples."""

import math

import numpy as np
import pytest

from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_sim.identification.findings import (
    NORMAL_90,
    Profile,
    combinations,
    faults,
    gains,
    misfit,
    parameters,
    profiles,
    together,
)
from dcdrw_sim.identification.fit import identify
from dcdrw_sim.identification.samples import free_rolling
from dcdrw_sim.identification.unknowns import Uncertainty, knowledge, unknowns_of
from dcdrw_sim.model.start import start
from dcdrw_sim.motion.ensemble import sample_pairs, spread
from dcdrw_sim.motion.trajectory import run

WHEEL = WheelParams(mass=9.0, gyration=math.sqrt(0.3), restitution=0.05)
TRUE = RigParams(WHEEL, WHEEL, b=110.0, D0=1.465, slope=math.radians(2.1), coupler_friction=0.4)
SAID = RigParams(WheelParams(mass=9.0), WheelParams(mass=9.0), slope=TRUE.slope)
"""What a lab knows: masses and slope."""
FIXED = ('mass', 'slope')
NOISE = math.radians(0.1)


def trial(rig=TRUE, phase=0.216, seconds=6.0, noise=NOISE, seed=1):
    motion = run(*start(rig, phase), seconds)
    times = np.arange(0.0, seconds, 1 / 60)
    at = motion.at(times)
    psi = np.column_stack([at.rotation1, at.rotation2])
    return times, psi + np.random.default_rng(seed).normal(0.0, noise, psi.shape)


@pytest.fixture(scope='module')
def fit():
    return identify(knowledge(SAID, FIXED), [free_rolling(SAID, *trial())])


def spoiled(part, seed=2):
    """A trial of which a part of the samples of each wheel is off by up to 1 rad."""
    times, psi = trial()
    rng = np.random.default_rng(seed)
    wild = rng.random(psi.shape) < part
    return times, psi + np.where(wild, rng.uniform(-1.0, 1.0, psi.shape), 0.0)


def deviations(fit, rig=TRUE):
    """How far each unknown is from the truth, in its standard errors."""
    truth = np.array([unknown.coordinate(rig.resolved()) for unknown in fit.known.unknowns])
    return (fit.coordinates - truth) / np.sqrt(np.diag(fit.covariance))


def test_samples_of_many_pairs_are_those_of_each():
    rig, state = start(TRUE, 0.216)
    times = np.array([0.0, 0.3, 1.7, 4.0])
    rotations = sample_pairs(spread(rig, 2, {'b': [110.0, 50.0]}), np.array([state, state]), times)
    for one, b in zip(rotations, (110.0, 50.0), strict=True):
        motion = run(rig._replace(b=b), state, 4.0).at(times)
        assert one == pytest.approx(np.column_stack([motion.rotation1, motion.rotation2]), abs=1e-9)


def test_a_pair_that_ends_stays_where_it_was():
    rig, state = start(TRUE, 0.216)
    level = rig._replace(slope=0.0)
    rotations = sample_pairs(spread(level, 1, {}), np.array([state]), np.array([0.0, 50.0, 60.0]))[0]
    assert (rotations[1] == rotations[2]).all()
    assert np.isfinite(rotations).all()


def test_what_made_a_trial_is_within_its_errors(fit):
    assert np.abs(deviations(fit)).max() < 3.0
    assert fit.trials[0].noise == pytest.approx(NOISE, rel=0.1)
    assert not any(misfit(fit, one) for one in fit.trials)


def test_residuals_without_noise_vanish():
    exact = identify(knowledge(SAID, FIXED), [free_rolling(SAID, *trial(noise=0.0, seconds=4.0))])
    assert exact.trials[0].noise < math.radians(0.003)


def test_gaps_and_outliers_do_not_spoil_it():
    times, psi = trial(seed=2)
    psi[50:60, 0] += 0.3
    psi[200] -= 0.2
    kept = np.r_[0:90, 120:260, 265:360]
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, times[kept], psi[kept])])
    assert found.trials[0].outliers.sum() == pytest.approx(12, abs=3)
    assert np.abs(deviations(found)).max() < 3.5


def test_a_trial_is_followed_until_a_wheel_stands():
    times, psi = trial()
    still = np.vstack([psi, np.repeat(psi[-1:], 120, axis=0)])
    later = np.arange(len(still)) / 60
    assert len(free_rolling(SAID, later, still).seconds) == pytest.approx(
        len(free_rolling(SAID, times, psi).seconds), abs=6
    )


def test_too_little_is_refused():
    with pytest.raises(ValueError, match='nothing can be told'):
        free_rolling(SAID, np.arange(10) / 60, np.zeros((10, 2)))


def test_several_trials_tell_more_than_one(fit):
    both = identify(
        knowledge(SAID, FIXED), [free_rolling(SAID, *trial()), free_rolling(SAID, *trial(phase=0.8, seed=3))]
    )
    assert (np.diag(both.covariance) < np.diag(fit.covariance)).all()
    assert np.abs(deviations(both)).max() < 3.0


def test_no_parameter_explains_a_wheel_that_was_pushed():
    times, psi = trial()
    psi[180:, 1] += 0.15 * (times[180:] - times[180])
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, times, psi)])
    left = misfit(found, found.trials[0])
    assert left is not None
    assert abs(left.worst) > NOISE
    assert not left.is_outliers


@pytest.mark.parametrize('wild', [0.1, 0.3])
def test_wild_samples_spoil_nothing(fit, wild):
    """Nor do they make the noise, or the errors, seem greater than they are."""
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, *spoiled(wild))])
    assert misfit(found, found.trials[0]) is None
    assert found.trials[0].outliers.mean() == pytest.approx(wild, abs=0.05)
    assert found.trials[0].noise == pytest.approx(fit.trials[0].noise, rel=0.2)
    assert np.abs(deviations(found)).max() < 3.0


def test_a_trial_of_which_half_the_samples_are_wild_is_told_so():
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, *spoiled(0.6))])
    assert misfit(found, found.trials[0]) is not None


def test_exact_degeneracies_are_named():
    """Neither the common scale nor slope against rolling resistance."""
    free = identify(knowledge(SAID._replace(slope=math.radians(2.0))), [free_rolling(SAID, *trial())])
    pairs = {frozenset(pair[:2]) for pair in together(free)}
    assert frozenset(('mass', 'b')) in pairs
    told = {finding.name: finding for finding in (*parameters(free), *combinations(free))}
    assert told['slope'].part > 0.8
    assert told['drive'].part < 0.3
    assert told['drift'].error / told['drift'].value < 0.1 < told['b'].error / told['b'].value
    assert any('weigh the wheels' in gain.what and 'b' in gain.errors for gain in gains(free)[:3])


def test_forces_are_told_in_proportion_to_k():
    """The equations hold m, k, b and F_c by their ratios alone."""
    rig, state = start(TRUE, 0.3)
    times, double = np.linspace(0.0, 3.0, 50), {'k': [10.5], 'b': [220.0], 'coupler_friction': [0.8]}
    masses = {'front.mass': [18.0], 'rear.mass': [18.0]}
    one = sample_pairs(spread(rig, 1, {}), np.array([state]), times)
    assert sample_pairs(spread(rig, 1, double | masses), np.array([state]), times) == pytest.approx(one, abs=1e-9)


def test_a_long_trial_on_a_slope_on_which_the_pair_hardly_rolls_is_followed():
    rig = TRUE._replace(slope=math.radians(1.35))
    found = identify(knowledge(SAID._replace(slope=rig.slope), FIXED), [free_rolling(SAID, *trial(rig, seconds=60.0))])
    assert found.trials[0].noise == pytest.approx(NOISE, rel=0.1)
    assert np.abs(deviations(found, rig)).max() < 3.5


def test_zeros_that_are_known_badly_are_found():
    times, psi = trial()
    psi[:, 0] += math.radians(0.5)
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, times, psi)], zero=math.radians(0.5))
    assert np.abs(deviations(found)).max() < 3.0
    index = len(found.known.unknowns) + 4
    error = math.sqrt(found.whole_covariance[index, index])
    assert found.trials[0].systematic[0, 0] == pytest.approx(math.radians(0.5), abs=3.0 * error)


@pytest.mark.parametrize('wheel', [0, 1])
def test_a_zero_that_is_wrong_is_told_and_allowed_for(wheel):
    times, psi = trial(seconds=10.0)
    psi[:, wheel] += math.radians(0.5)
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, times, psi)])
    [fault] = faults(found, 0)
    assert fault.wheel == wheel
    assert fault.value == pytest.approx(math.radians(0.5), abs=3.0 * fault.error)
    assert np.abs(deviations(found)).max() < 3.0


@pytest.mark.parametrize('late', [-0.02, 0.02])
def test_a_wheel_whose_stamps_are_late_is_told_and_allowed_for(late):
    """Whichever wheel it is: the other one's are early."""
    times, psi = trial(seconds=10.0)
    motion = run(*start(TRUE, 0.216), 11.0)
    noise = psi[:, 1] - motion.at(times).rotation2
    psi[:, 1] = motion.at(np.maximum(times - late, 0.0)).rotation2 + noise
    found = identify(knowledge(SAID, FIXED), [free_rolling(SAID, times[2:], psi[2:])])
    [fault] = faults(found, 0)
    assert fault.wheel is None
    assert fault.value == pytest.approx(late, abs=3.0 * fault.error)
    assert np.abs(deviations(found)).max() < 3.0


def test_a_record_without_faults_has_none(fit):
    assert not fit.allowing
    assert faults(fit, 0) == []


def test_profiles_are_parabolas_where_errors_are_even(fit):
    found = {profile.name: profile for profile in profiles(fit)}
    error = math.sqrt(fit.covariance[0, 0])
    profile = found[fit.known.unknowns[0].name]
    assert profile.deviance == pytest.approx(((profile.values - fit.coordinates[0]) / error) ** 2, rel=0.3, abs=0.2)


def test_intervals_end_where_profiles_leave_them():
    even = Profile('even', np.array([-2.0, -1.0, 0.0, 1.0, 2.0]), np.array([4.0, 1.0, 0.0, 1.0, 4.0]))
    assert even.interval == pytest.approx((-NORMAL_90, NORMAL_90))
    bound = Profile('bound', np.array([0.0, 1.0, 4.0]), np.array([0.5, 0.0, 9.0]))
    assert bound.interval == pytest.approx((0.0, 1.0 + NORMAL_90))


def test_a_skew_problem_has_skew_intervals():
    """With nothing given, masses, damping and rest length go together, far up rather than far down."""
    found = identify(knowledge(SAID._replace(slope=math.radians(2.0))), [free_rolling(SAID, *trial(seconds=10.0))])
    told = {finding.name: finding for finding in parameters(found, profiles(found))}
    assert told['D0'].high - told['D0'].value > 1.3 * (told['D0'].value - told['D0'].low)
    for name, truth in (('D0', TRUE.D0), ('b', TRUE.b), ('mass', 9.0), ('coupler_friction', TRUE.coupler_friction)):
        assert told[name].low <= truth <= told[name].high


def test_what_was_known_before_is_kept():
    """A second look at nothing new: the errors of the file, correlations and all."""
    stated = Uncertainty(
        {'b': 5.0, 'D0': 0.01, 'mass': 0.0}, np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])
    )
    known = knowledge(TRUE, uncertainty=stated)
    names = [unknown.name for unknown in known.unknowns]
    assert 'mass' not in names
    again = known.uncertainty
    assert again.errors['b'] == pytest.approx(5.0)
    order = list(again.errors)
    assert again.correlations[order.index('b'), order.index('D0')] == pytest.approx(0.5)
    drawn = known.draw(2000, seed=1)
    assert np.std(drawn['b']) == pytest.approx(5.0, rel=0.1)
    assert np.corrcoef(drawn['b'], drawn['D0'])[0, 1] == pytest.approx(0.5, abs=0.1)


def test_wheels_that_differ_are_sought_one_by_one():
    names = [unknown.name for unknown in unknowns_of(SAID._replace(rear=SAID.rear._replace(mass=12.0)))]
    assert {'front.mass', 'rear.mass', 'gyration_squared'} <= set(names)
    with pytest.raises(ValueError, match='did you mean mass'):
        knowledge(SAID, fixed=('masss',))
