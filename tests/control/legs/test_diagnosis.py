import math

from dcdrw_control.legs.diagnosis import diagnose_legs
from dcdrw_control.legs.params import LegParams
from dcdrw_control.legs.samples import ContactReading, ImuReading, Leg, LegReading
from dcdrw_control.legs.tracker import LegTracker
from dcdrw_msgs_py.diagnosis import Level

LEFT, RIGHT = Leg('front', 'left'), Leg('front', 'right')


def diagnosis(tracker: LegTracker, age: float = 0.0):
    return diagnose_legs(tracker.status(), age, 1.0)


def take(tracker: LegTracker, leg: Leg, seconds: float, touches: bool = True) -> None:
    tracker.update(LegReading(round(seconds * 1e9), leg, ContactReading(touches)))


def test_without_readings_it_is_stale():
    told = diagnosis(LegTracker(LegParams()), math.inf)
    assert told.level == Level.STALE


def test_each_trouble_has_its_message():
    tracker = LegTracker(LegParams())
    take(tracker, LEFT, 1.0)
    told = diagnosis(tracker)
    assert (told.level, told.message) == (Level.WARN, 'only one leg of the front half has a sensor')
    take(tracker, RIGHT, 1.0)
    assert diagnosis(tracker).message == 'waiting for a heel strike of front_left, front_right'
    take(tracker, RIGHT, 2.0)
    told = diagnosis(tracker)
    assert (told.level, told.message) == (Level.WARN, 'silent: the sensor of front_left')
    assert told.values['front_left sensor'] == 'contact'


def test_a_sensor_whose_mounting_is_unknown_asks_for_steps():
    tracker = LegTracker(LegParams())
    for leg in (LEFT, RIGHT):
        tracker.update(LegReading(1_000_000_000, leg, ImuReading((0.0, 0.0, 0.0), (0.0, 0.0, 9.8))))
    assert diagnosis(tracker).message.startswith('learning the mounting of front_left, front_right')


def test_legs_that_walk_are_followed():
    tracker = LegTracker(LegParams())
    for index in range(400):
        for leg, ahead in ((LEFT, 0.0), (RIGHT, 0.5)):
            take(tracker, leg, index / 100, (index / 100 + ahead) % 1.0 < 0.6)
    told = diagnosis(tracker)
    assert (told.level, told.message) == (Level.OK, 'following front_left, front_right')
    assert told.values['front_left strikes'] == 3
