import math
from types import SimpleNamespace

import pytest

from dcdrw_control.legs.conversion import READERS, hip_readings
from dcdrw_control.legs.params import HIPS
from dcdrw_control.legs.samples import ContactReading, HipReading, ImuReading, Leg, WrenchReading
from dcdrw_msgs_py.topics import LEG_SENSORS


def vector(x: float, y: float, z: float) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z)


def joints(names: list[str], position: list[float], velocity: list[float] | tuple[()] = ()) -> SimpleNamespace:
    return SimpleNamespace(name=names, position=position, velocity=velocity)


def test_every_sensor_has_a_reader():
    assert {kind for _, _, kind in LEG_SENSORS} == READERS.keys()
    imu = SimpleNamespace(angular_velocity=vector(1.0, 2.0, 3.0), linear_acceleration=vector(4.0, 5.0, 6.0))
    assert READERS['imu'](imu) == ImuReading((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert READERS['contact'](SimpleNamespace(data=True)) == ContactReading(True)
    wrench = SimpleNamespace(wrench=SimpleNamespace(force=vector(7.0, 8.0, -700.0)))
    assert READERS['wrench'](wrench) == WrenchReading(-700.0)


def test_hips_are_found_by_name_in_any_order_and_company():
    found = hip_readings(joints(['knee', HIPS[3], HIPS[0]], [9.0, 0.3, 0.1], [9.0, 3.0, 1.0]), HIPS)
    assert found == [(Leg('front', 'left'), HipReading(0.1, 1.0)), (Leg('rear', 'right'), HipReading(0.3, 3.0))]
    ((_, without_rate),) = hip_readings(joints([HIPS[0]], [0.1]), HIPS)
    assert math.isnan(without_rate.rate)


@pytest.mark.parametrize(
    ('message', 'told'),
    [
        (joints(['knee'], [1.0]), 'none of the hips'),
        (joints([HIPS[0], HIPS[0]], [1.0, 1.0]), 'named once'),
        (joints([HIPS[0]], []), '1 joint name but 0 positions given'),
    ],
)
def test_a_message_without_a_hip_says_why(message, told):
    with pytest.raises(ValueError, match=told):
        hip_readings(message, HIPS)
