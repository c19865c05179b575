"""Joint angles over a stride: closed forms, the recorded person, and what no table is."""

import math

import numpy as np
import pytest

from dcdrw_control.reference.joint_table import DEFAULT, JointTable, read_joint_table
from dcdrw_control.reference.recorded_gait import LEG, STRETCHED, joint_angles, table
from tests import ROOT

DATA = ROOT / 'tests' / 'data' / 'gait'


def test_splines_go_through_a_harmonic_and_its_slope():
    strides = np.arange(40) / 40.0
    harmonic = JointTable(('hip',), strides, np.sin(math.tau * strides)[:, None])
    fine = np.linspace(-1.0, 2.0, 301)
    assert harmonic.angles(fine)[:, 0] == pytest.approx(np.sin(math.tau * fine), abs=1e-5)
    assert harmonic.slopes(fine)[:, 0] == pytest.approx(math.tau * np.cos(math.tau * fine), abs=2e-3)


def test_the_default_table_is_made_of_the_recorded_heels():
    made = table(DATA / 'mocap_heels.csv', DATA / 'stride_events_sample.csv')
    assert DEFAULT.read_text() == made


def test_hip_and_knee_put_the_heel_where_it_was():
    """Forward kinematics of two links of half a leg each, knee behind hip."""
    ahead, above = np.linspace(-0.35, 0.4, 20), np.linspace(0.3, 0.04, 20)
    hip, knee = joint_angles(ahead, above)
    x = 0.5 * LEG * (np.sin(hip) + np.sin(hip - knee))
    z = 0.5 * LEG * (np.cos(hip) + np.cos(hip - knee))
    assert x == pytest.approx(ahead)
    assert np.ptp(z + above) == pytest.approx(0.0, abs=1e-12)
    assert np.hypot(x, z).max() == pytest.approx(STRETCHED * LEG)


def test_a_table_of_other_joints_is_read(tmp_path):
    (tmp_path / 'gait.csv').write_text('stride, ankle\n0,0.1\n0.25,0.2\n0.5,0.1\n0.75,0\n')
    read = read_joint_table(tmp_path / 'gait.csv')
    assert read.names == ('ankle',)
    assert read.angles([0.25, 1.75])[:, 0] == pytest.approx([0.2, 0.0])


@pytest.mark.parametrize(
    ('text', 'named'),
    [
        ('', 'first row'),
        ('time,hip\n', 'first row'),
        ('stride,hip,hip\n', 'each name its own'),
        ('stride,hip\n0,1\n0.5,1\n', 'at least 4'),
        ('stride,hip\n0,1\n0.5,x\n', 'line 3'),
        ('stride,hip\n0,1\n0.5\n', 'line 3'),
        ('stride,hip\n0,1\n0.5,nan\n', 'line 3'),
        ('stride,hip\n0,1\n0.5,1\n0.4,1\n0.6,1\n', 'grow'),
        ('stride,hip\n0,1\n0.5,1\n0.7,1\n1,1\n', 'less than 1'),
    ],
)
def test_what_is_no_table_is_told_with_its_place(tmp_path, text, named):
    path = tmp_path / 'gait.csv'
    path.write_text(text)
    with pytest.raises(ValueError, match=named):
        read_joint_table(path)
