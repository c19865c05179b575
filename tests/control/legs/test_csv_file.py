import math

import pytest
from legs import DATA, RATE

from dcdrw_control.legs.csv_file import read_legs
from dcdrw_control.legs.samples import ContactReading, HipReading, ImuReading, Leg, LegReading, WrenchReading

LEFT, RIGHT = Leg('front', 'left'), Leg('front', 'right')


def test_a_file_of_two_heading_rows_is_read_with_its_rate():
    table = read_legs(DATA / 'imu_sample.csv', RATE)
    assert len(table.readings) == 2 * 7928
    assert table.rate == pytest.approx(RATE)
    assert table.degrees
    stamp, leg, reading = table.readings[-1]
    assert stamp / 1e9 == pytest.approx(7927 / RATE)
    assert leg == RIGHT
    assert math.hypot(*reading.acceleration) == pytest.approx(9.8, abs=0.3)


def test_a_file_without_heading_is_time_and_force():
    table = read_legs(DATA / 'example_vertical_grf.csv')
    assert table.readings[0] == LegReading(534_133_513_000, LEFT, WrenchReading(235.311661))
    assert table.rate == pytest.approx(100.0, rel=0.01)


def test_every_sensor_of_every_leg_has_columns(tmp_path):
    imu = [f'left_{kind}_{axis}' for kind in ('acc', 'gyr') for axis in 'xyz']
    path = tmp_path / 'all.csv'
    path.write_text(
        f'time,{",".join(imu)},right_contact,rear_left_force,rear_right_hip,note\n'
        '0.5,0,0,9.8,1,2,3,1,-700,0.2,5\n0.51,0,0,9.7,1,2,3,0,-690,0.3,6\n'
    )
    table = read_legs(path)
    assert not table.degrees
    first = {reading.leg: reading.reading for reading in table.readings if reading.stamp_ns == 500_000_000}
    hip = first.pop(Leg('rear', 'right'))
    assert first == {
        LEFT: ImuReading((1.0, 2.0, 3.0), (0.0, 0.0, 9.8)),
        RIGHT: ContactReading(True),
        Leg('rear', 'left'): WrenchReading(-700.0),
    }
    assert isinstance(hip, HipReading)
    assert hip.angle == 0.2
    assert math.isnan(hip.rate)


def test_a_file_of_one_leg_names_no_side_and_needs_no_time_where_the_rate_is_given(tmp_path):
    path = tmp_path / 'one.csv'
    path.write_text('force\n700\n690\n0\n')
    table = read_legs(path, rate=10.0)
    assert [reading.stamp_ns for reading in table.readings] == [0, 100_000_000, 200_000_000]
    assert {reading.leg for reading in table.readings} == {LEFT}


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('', 'names no columns'),
        ('time,left_force\n', 'there should be some'),
        ('time,speed\n0,1\n1,2\n', 'no column of a leg'),
        ('time,left_force\n0,1\n1,two\n', "line 3: 'two' is not a number"),
        ('time,left_force\n0,1\n1\n', 'line 3: 1 cell, not 2 as in the first row'),
        ('time,left_force\n0,1\ninf,2\n', "line 3: 'inf' is not a number"),
        ('time,left_force\n0,1\n0.1,1_0\n', "line 3: '1_0' is not a number"),
        ('time,left_force\n0,1\n,2\n', 'a time in column time is none'),
        ('time,left_force,right_force\n0,1,\n0.1,2,nan\n', 'the column right_force has no number: leave it out'),
        ('time [min],left_force\n0,1\n1,2\n', "column time: 'min' is not a unit like s"),
        ('time,left_hip [N]\n0,1\n1,2\n', "column left_hip: 'N' is not a unit like rad"),
        ('time,left_force\n0,1\n10,2\n20,3\n', r'10 s lie between .* in another unit.*time \[ms\]'),
        ('stamp_ns,left_force\n0,1\n10,2\n20,3\n', '1e-08 s lie between'),
        ('time;left_force\n0,00;1.5\n0,01;2\n', "line 2: '0,00' is not a number"),
        ('time,left_force\n0,1\n1e30,2\n', 'a time in column time is none'),
        ('time,left_force,left_force\n0,1,2\n1,2,3\n', 'has two columns left_force'),
        ('time,left_force\n0,1\n0,2\n', 'must grow'),
        ('sample,left_force\n0,1\n1,2\n', '--rate'),
        ('time,left_force,rigth_force\n0,1,1\n0.1,2,2\n', 'column rigth_force is none .* did you mean right_force?'),
        ('time,left_force,force_right\n0,1,1\n0.1,2,2\n', 'column force_right is none .* did you mean right_force?'),
        ('time,Rear Left Gyro X\n0,1\n0.1,2\n', 'column rear left gyro x .* did you mean rear_left_gyr_x?'),
        ('time,left_gyr_x\n0,1\n1,2\n', 'left_gyr_y'),
    ],
)
def test_a_file_that_cannot_be_read_says_why(tmp_path, text, told):
    path = tmp_path / 'bad.csv'
    path.write_text(text)
    with pytest.raises(ValueError, match=told) as error:
        read_legs(path)
    assert str(path) in str(error.value)


def test_other_sensors_columns_are_passed_over(tmp_path):
    path = tmp_path / 'more.csv'
    others = 'front_left_mag_x,left_knee,left_hip_torque,emg,left_force_2,battery'
    path.write_text(f'time,left_force,{others}\n0,700,1,2,3,4,5,6\n0.01,690,1,2,3,4,5,6\n')
    assert {type(reading.reading) for reading in read_legs(path).readings} == {WrenchReading}


def test_names_are_read_in_any_case_and_with_their_units_and_an_empty_cell_makes_no_row_a_heading(tmp_path):
    path = tmp_path / 'named.csv'
    path.write_text('Time [s],Left_Force (N),right_force\n0,1,\n0.1,2,3\n')
    forces = [(str(reading.leg), reading.reading.force) for reading in read_legs(path).readings]
    assert forces[0] == ('front_left', 1.0)
    assert len(forces) == 4


@pytest.mark.parametrize(
    'text',
    [
        'time;left_force\n0,00;700,5\n0,01;690\n',
        'time\tleft_force\n0.00\t700.5\n0.01\t690\n',
        '# a walk\ntime [ms],left_force [kN]\n0,0.7005\n\n# and on\n10,0.69\n,\n',
        '0,00;700,5\n0,01;690\n',
    ],
    ids=['semicolons', 'tabs', 'units and remarks', 'no heading'],
)
@pytest.mark.parametrize('encoding', ['utf-8', 'utf-16'])
def test_separators_decimal_commas_units_and_remarks_all_tell_the_same(text, encoding, tmp_path):
    path = tmp_path / 'force.csv'
    path.write_bytes(text.encode(encoding))
    table = read_legs(path)
    assert [reading.stamp_ns for reading in table.readings] == [0, 10_000_000]
    assert [reading.reading.force for reading in table.readings] == pytest.approx([700.5, 690.0])


def test_readings_are_in_the_units_that_the_heading_names(tmp_path):
    path = tmp_path / 'units.csv'
    imu = [f'left_acc_{axis} [g]' for axis in 'xyz'] + [f'left_gyr_{axis} [deg/s]' for axis in 'xyz']
    path.write_text(f'time,{",".join(imu)},right_hip (deg)\n0,0,0,1,10,20,-30,90\n0.1,0,0,1,10,20,-30,90\n')
    table = read_legs(path)
    readings = {reading.leg: reading.reading for reading in table.readings}
    assert readings[LEFT].acceleration == pytest.approx((0.0, 0.0, 9.80665))
    assert readings[LEFT].rate == pytest.approx([math.radians(rate) for rate in (10.0, 20.0, -30.0)])
    assert readings[RIGHT].angle == pytest.approx(math.pi / 2)
    assert not table.degrees
    path.write_text(path.read_text().replace('deg/s', 'rad/s').replace('10,20', '100,20'))
    assert read_legs(path).readings[0].reading.rate == pytest.approx((100.0, 20.0, -30.0))


def test_a_contact_that_is_unknown_is_none(tmp_path):
    path = tmp_path / 'contact.csv'
    path.write_text('time,left_contact,right_contact\n0,1,0\n0.1,,0\n0.2,0,\n')
    contacts = [(reading.leg, reading.reading.touches) for reading in read_legs(path).readings]
    assert contacts == [(LEFT, True), (RIGHT, False), (RIGHT, False), (LEFT, False)]
