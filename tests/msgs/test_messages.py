"""Between messages and samples."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import JointState

from dcdrw_msgs_py.diagnosis import STATE, Diagnosis, Level, PairState, RecorderState
from dcdrw_msgs_py.messages import (
    JointSampleReader,
    JointSampleWriter,
    PhaseSampleReader,
    PhaseSampleWriter,
    diagnoses,
    diagnostics_message,
    footfall,
    footfall_message,
    run_message,
    stamp_ns,
    to_stamp,
)
from dcdrw_msgs_py.samples import CouplerSample, Footfall, JointSample, PhaseSample, Turn

stamps = st.integers(0, 2**31 * 10**9 - 1)
numbers = st.floats(allow_nan=False)
turns = st.builds(Turn, numbers, numbers)


@given(stamps)
def test_stamps_survive(stamp):
    assert stamp_ns(to_stamp(stamp)) == stamp


@given(
    st.builds(
        JointSample, stamps, turns, turns, st.builds(CouplerSample, numbers, numbers, numbers), st.integers(0, 2**63)
    )
)
def test_joint_samples_survive(sample):
    reader = JointSampleReader()
    if sample.run:
        header = run_message(sample.stamp_ns, sample.run)
        reader.runs.announce(stamp_ns(header.stamp), header.frame_id)
    message = JointSampleWriter().write(sample)
    assert reader.read(message) == sample
    message.header.frame_id = 'run_9'  # a frame is not a protocol
    assert reader.read(message) == sample


counts = st.integers(-1000, 1000)


@given(
    st.builds(
        PhaseSample,
        stamps,
        turns,
        turns,
        turns,
        counts,
        st.integers(0, 1000),
        counts,
        counts,
        st.integers(1, 9),
        st.floats(0.0, 2.0),
    )
)
def test_phase_samples_survive(sample):
    assert PhaseSampleReader().read(PhaseSampleWriter().write(sample)) == sample


@given(st.builds(Footfall, st.sampled_from(['front', 'rear']), stamps, st.floats(-1e6, 1e6)))
def test_footfalls_survive(fall):
    message = footfall_message(fall)
    assert footfall(message, fall.wheel) == fall._replace(steps=-1)  # the steps are in phase_state
    assert message.header.frame_id == 'slope'  # as the URDF has it


@pytest.mark.parametrize('x', [math.inf, -math.inf, math.nan])
def test_a_footfall_nowhere_is_refused(x):
    with pytest.raises(ValueError, match='footfall must be finite'):
        footfall(footfall_message(Footfall('front', 0, x)), 'front')


@given(st.permutations(['front_wheel', 'rear_wheel', 'coupler', 'hip', 'knee']))
def test_joint_order_and_company_do_not_matter(names):
    where = {'front_wheel': 1.0, 'rear_wheel': 2.0, 'coupler': 3.0}
    message = JointState(name=names, position=[where.get(name, 9.0) for name in names])
    sample = JointSampleReader().read(message)
    assert (sample.front.angle, sample.rear.angle, sample.coupler.length) == (1.0, 2.0, 3.0)
    assert math.isnan(sample.front.rate)


def test_reader_follows_a_source_that_changes_its_order():
    reader = JointSampleReader()
    first = reader.read(JointState(name=['front_wheel', 'rear_wheel'], position=[1.0, 2.0]))
    second = reader.read(JointState(name=['rear_wheel', 'front_wheel'], position=[2.0, 1.0]))
    assert str(first) == str(second)  # NaN differs from itself


@pytest.mark.parametrize(
    ('names', 'positions', 'message'),
    [
        ([], [], 'joint front_wheel is missing; the message names none'),
        (['front_wheel', 'Rear'], [1.0, 2.0], 'joint rear_wheel is missing; the message names front_wheel, Rear'),
        (['front_wheel', 'rear_wheel'], [1.0], '2 joint names but 1 position given'),
        (['front_wheel', 'rear_wheel', 'rear_wheel'], [1.0, 2.0, 3.0], 'joint rear_wheel stands twice'),
    ],
)
def test_what_cannot_be_read_is_named(names, positions, message):
    with pytest.raises(ValueError, match=message):
        JointSampleReader().read(JointState(name=names, position=positions))


def test_phase_message_of_a_stranger_needs_no_frame_and_no_counts():
    message = PhaseSampleWriter().write(PhaseSample(1, Turn(0.1, 1.0), Turn(0.2, 1.0), Turn(0.3, 0.0), 1, 7))
    message.header.frame_id = 'map'
    assert PhaseSampleReader().read(message).restarts == 7
    del message.name[4:], message.position[4:], message.velocity[4:]
    assert PhaseSampleReader().read(message).restarts == 0


def test_diagnosis_is_one_status_with_its_figures():
    message = diagnostics_message('lab/sync_monitor', Diagnosis(Level.STALE, 'no data yet', {'n': 0}), 5)
    (status,) = message.status
    assert (status.level, status.name, status.message) == (b'\x03', 'lab/sync_monitor', 'no data yet')
    assert [(pair.key, pair.value) for pair in status.values] == [('n', '0')]


def test_diagnosis_is_read_as_it_was_written():
    said = Diagnosis(
        Level.WARN, 'words', {STATE: PairState.LOST, 'n': 2, 'error [%]': -7.5, 'is': True, 'not': math.nan}
    )
    read = diagnoses(diagnostics_message('/sync_monitor', said, 5))['sync_monitor']
    assert (read.level, read.message) == (Level.WARN, 'words')
    for one in (said, read):
        assert one.state(PairState) is PairState.LOST
        assert one.state(RecorderState) is None
        assert (one.number('n'), one.number('error [%]')) == (2.0, -7.5)
        assert math.isnan(one.number('not'))
        assert math.isnan(one.number('nowhere'))
        assert one.flag('is')
        assert not one.flag('nowhere')


@pytest.mark.parametrize(
    ('name', 'hardware'),
    [('/sync_monitor', 'dcdrw'), ('/lab/sync_monitor', 'dcdrw/lab'), ('/lab/left/recorder', 'dcdrw/lab/left')],
)
def test_each_rig_has_its_own_hardware_id(name, hardware):
    (status,) = diagnostics_message(name, Diagnosis(Level.OK, '', {}), 5).status
    assert (status.name, status.hardware_id) == (name[1:], hardware)
