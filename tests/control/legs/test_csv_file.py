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
        ('time,left_force\n0,1\ninf,2\n', 'a time in column time is none'),
        ('time,left_force\n0,1\n1e30,2\n', 'a time in column time is none'),
        ('time;left_force\n0;1\n1;2\n', 'should have commas between them'),
        ('time,left_force,left_force\n0,1,2\n1,2,3\n', 'has two columns left_force'),
        ('time,left_force\n0,1\n0,2\n', 'must grow'),
        ('sample,left_force\n0,1\n1,2\n', '--rate'),
        ('time,left_gyr_x\n0,1\n1,2\n', 'left_gyr_y'),
    ],
)
def test_a_file_that_cannot_be_read_says_why(tmp_path, text, told):
    path = tmp_path / 'bad.csv'
    path.write_text(text)
    with pytest.raises(ValueError, match=told) as error:
        read_legs(path)
    assert str(path) in str(error.value)


def test_names_are_read_in_any_case_and_with_their_units_and_an_empty_cell_makes_no_row_a_heading(tmp_path):
    path = tmp_path / 'named.csv'
    path.write_text('Time [s],Left_Force (N),right_force\n0,1,\n1,2,3\n')
    forces = [(str(reading.leg), reading.reading.force) for reading in read_legs(path).readings]
    assert forces[0] == ('front_left', 1.0)
    assert len(forces) == 4
