"""Wheels that come in messages of their own, as from one motor controller each, made samples of both."""

import math
from collections import deque

from dcdrw_msgs_py.rig import FRONT
from dcdrw_msgs_py.samples import JointSample, LoneWheel, Turn

LONGEST_PAUSE_NS = 100_000_000
"""Over a longer pause of the rear wheel's messages nothing is interpolated."""


class WheelPairs:
    """Makes a sample at each stamp of the front wheel; the rear one is interpolated between its own on either side."""

    def __init__(self) -> None:
        self._front: deque[LoneWheel] = deque()
        self._rear: deque[LoneWheel] = deque()
        self.unpaired = 0
        """Messages of a wheel to which none of the other one belongs, so far."""

    def take(self, wheel: LoneWheel) -> list[JointSample]:
        """Take the next message of a wheel; returns the samples that it completes, in order."""
        queue = self._front if wheel.wheel == FRONT else self._rear
        if queue and wheel.stamp_ns < queue[-1].stamp_ns:
            queue.clear()  # the stream has started anew
        elif queue and wheel.stamp_ns == queue[-1].stamp_ns:
            queue.pop()
            self.unpaired += 1
        queue.append(wheel)
        waiting = self._rear
        while len(waiting) > 2 and waiting[-1].stamp_ns - waiting[1].stamp_ns > LONGEST_PAUSE_NS:
            waiting.popleft()
            self.unpaired += 1
        samples = []
        while self._front and not self._awaited(self._front[0].stamp_ns):
            front = self._front.popleft()
            rear = self._rear_at(front.stamp_ns)
            if rear is None:
                self.unpaired += 1
            else:
                samples.append(JointSample(front.stamp_ns, front.turn, rear, front.coupler, front.run))
        return samples

    def _awaited(self, stamp_ns: int) -> bool:
        """Whether the rear wheel's message of that instant or after it may yet come; those long before are dropped."""
        rear = self._rear
        while len(rear) > 1 and rear[1].stamp_ns <= stamp_ns:
            rear.popleft()
        come = bool(rear) and rear[-1].stamp_ns >= stamp_ns and (rear[0].stamp_ns <= stamp_ns or len(rear) > 1)
        return not come and self._front[-1].stamp_ns - stamp_ns <= LONGEST_PAUSE_NS

    def _rear_at(self, stamp_ns: int) -> Turn | None:
        """The rear wheel at an instant, also at one less than a period before its first message."""
        rear = self._rear
        if not rear:
            return None
        earlier = rear[0]
        if earlier.stamp_ns == stamp_ns:
            return earlier.turn
        if len(rear) == 1 or rear[1].stamp_ns - earlier.stamp_ns > LONGEST_PAUSE_NS:
            return None
        later = rear[1]
        if earlier.stamp_ns - stamp_ns > later.stamp_ns - earlier.stamp_ns:
            return None
        share = (stamp_ns - earlier.stamp_ns) / (later.stamp_ns - earlier.stamp_ns)
        moved = later.turn.angle - earlier.turn.angle
        if abs(moved) > math.pi:  # wrapped, or the counter rolled over: it is where it was, or where it is
            return earlier.turn if share < 0.5 else later.turn
        rate = earlier.turn.rate + share * (later.turn.rate - earlier.turn.rate)
        return Turn(earlier.turn.angle + share * moved, rate)
