import pytest

from dcdrw_tracker.gait.rivals import Rivals

FRONT, REAR, BOTH, ARM, HAND = ('front_wheel',), ('rear_wheel',), ('front_wheel', 'rear_wheel'), ('elbow',), ('thumb',)


@pytest.mark.parametrize(
    ('heard', 'nodes', 'contested'),
    [
        ([BOTH], ['/rig'], False),
        ([BOTH], ['/rig', '/simulator'], True),
        ([BOTH, (*BOTH, 'coupler')], ['/simulator', '/tag_tracker'], True),
        ([FRONT, REAR], ['/left', '/right'], False),  # each controller sends its own wheel
        ([FRONT, REAR], ['/left', '/left', '/right'], True),
        ([BOTH, FRONT], ['/rig', '/left'], True),
        ([BOTH, ARM, HAND], ['/rig', '/arm', '/hand'], False),  # which have no wheels
        ([BOTH, ARM], ['/rig', '/simulator', '/arm'], True),
        ([ARM], ['/arm', '/other'], False),
        ([], ['/one', '/other'], False),
    ],
)
def test_nodes_that_send_the_same_wheels_are_told_from_those_that_share_them(heard, nodes, contested):
    rivals = Rivals(BOTH)
    for names in heard:
        rivals.hear(names)
    assert list(rivals.among(nodes)) == (nodes if contested else [])


def test_what_came_long_ago_explains_nothing():
    rivals = Rivals(BOTH)
    rivals.hear(ARM)
    for _ in range(3):
        rivals.hear(BOTH)
        told = rivals.among(['/rig', '/simulator'])
    assert told
