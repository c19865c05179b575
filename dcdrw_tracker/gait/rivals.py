"""Whether several nodes send the joint states of the same wheels: knows no ROS."""

from collections.abc import Sequence


class Rivals:
    """Tells nodes that send the same wheels from those that share them out, or send joints of other names.

    Two motor controllers may each send their own wheel, and a robot's arm publishes `joint_states`, too.

    Args:
        wheels: the joints of both wheels.

    """

    def __init__(self, wheels: Sequence[str]) -> None:
        self._wheels = frozenset(wheels)
        self._heard: set[tuple[str, ...]] = set()
        self._before: set[tuple[str, ...]] = set()

    def hear(self, names: Sequence[str]) -> None:
        """A message has come that names these joints."""
        self._heard.add(tuple(names))

    def among(self, nodes: Sequence[str]) -> Sequence[str]:
        """The nodes, of those that publish, where more of them do than what came lately explains; else nobody.

        To be asked now and then: lately is since the last time but one.
        """
        heard = self._heard | self._before
        self._heard, self._before = set(), self._heard
        wheels = {self._wheels.intersection(names) for names in heard}
        if not any(wheels):
            return ()
        sharing = 1 if self._wheels in wheels else len(wheels - {frozenset()})
        others = sum(self._wheels.isdisjoint(names) for names in heard)
        return nodes if len(nodes) > sharing + others else ()
