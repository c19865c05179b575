"""The node `simulator`: the rig in simulation, in the place of the real one."""

import math
import sys
import time
from contextlib import suppress
from functools import partial
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import SetBool, Trigger

from dcdrw_msgs_py.diagnosis import STATE, STEP_DIFFERENCE, Diagnosis, Level, SourceState
from dcdrw_msgs_py.messages import JointSampleWriter, run_message, to_stamp
from dcdrw_msgs_py.node import Age, Parameters, advertise, listen_aged, publish_diagnosis, run, steady_clock
from dcdrw_msgs_py.rig import FRONT, REAR, RigParams
from dcdrw_msgs_py.samples import SECOND
from dcdrw_msgs_py.topics import (
    CLOCK,
    COUPLER_FORCE_COMMAND,
    JOINT_STATES,
    PERSON_FORCE,
    REAR_TORQUE_COMMAND,
    RUNS,
    Topic,
)
from dcdrw_msgs_py.wire import wrench_bytes
from dcdrw_msgs_py.words import counted
from dcdrw_sim.motion.ends import MotionError, accept
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams, Timeline

SHORTEST_TICK = 0.0005
"""Samples that are due more often are published in bursts [s]."""
PREPARE_WITHIN = 0.02
"""A sample that is due so soon is prepared at once, so that it is on time [s]."""
BURST_SECONDS = 0.02
"""Time in one callback at most, so that services and signals are served however far behind the pace is."""
CLOCK_RATE = 100.0
"""Messages on /clock per simulated second at most [Hz]."""
CATCH_UP = 4.0
"""After a pause of this process samples come at most so many times as fast, so that whoever listens keeps up."""
CLOCK_JUMP = 10.0
"""A clock that goes on by more than this from one tick to the next was set [s]; the wheels do not race after it."""
CLOCK_START_NS = SECOND
"""Simulated time at the start: 0 means `no clock yet` in ROS."""


class SimulatorNode(Node):
    """Publishes what a `SimulatedRig` does, at the pace of the node's clock, or of its own /clock."""

    _timeline: Timeline
    _run: int

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('simulator', **kwargs)
        self._rig_parameters = Parameters(self, RigParams, lambda rig: self._rig.configure(rig), accept)
        self._settings = Parameters(self, SimulatorParams, self._configure, SimulatorParams.check_pace)
        params = self._settings.value
        self._rig = SimulatedRig(self._rig_parameters.value, params)
        # As its own clock's source it cannot wait for that clock.
        self._pace_clock = steady_clock() if params.publish_clock else self.get_clock()
        self._paused = params.paused
        self._failure = ''
        self._refused_commands = 0
        self._commands = {COUPLER_FORCE_COMMAND: Age(), REAR_TORQUE_COMMAND: Age()}
        self._writer = JointSampleWriter()
        self._runs = advertise(self, RUNS)
        # Not 1: a simulator that was started anew must not seem to go on with the run of the one before.
        self._run = time.time_ns() // SECOND
        self._announced = False
        self._joint_states = advertise(self, JOINT_STATES)
        self._clock_publisher = advertise(self, CLOCK) if params.publish_clock else None
        self._person_force = advertise(self, PERSON_FORCE) if params.person.walks else None
        for topic in self._commands:
            listen_aged(self, topic, partial(self._on_command, topic))
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self._report = publish_diagnosis(self, self._diagnose)
        self._timer = self.create_timer(self._period(), self._tick, clock=steady_clock())
        self._restart()
        doing = 'holding the wheels' if self._paused else 'rolling'
        self.get_logger().info(f'{doing}, {counted(f"{params.rate:g}", "sample")} per second')

    def _now(self) -> float:
        return float(self._pace_clock.now().nanoseconds) / SECOND

    def _period(self) -> float:
        """Time from tick to tick [s]: a sample's, as far as a timer can follow."""
        params = self._settings.value
        pace = params.rate * params.real_time_factor
        return max(1.0 / pace, SHORTEST_TICK) if pace else SHORTEST_TICK

    def _burst(self) -> int:
        """Samples at most in one tick."""
        params = self._settings.value
        pace = params.rate * params.real_time_factor
        return math.ceil(CATCH_UP * pace * self._period()) if pace else sys.maxsize

    def _follow(self, now: float) -> None:
        """Go on with the motion at another time of the clock."""
        self._timeline.restart_clock(now)
        if not self._clock_publisher:
            self._epoch_ns = round((now - self._timeline.due) * SECOND)

    def _restart(self) -> None:
        params = self._settings.value
        self._last_now = self._now()
        # Samples fall due when the timer does: each is published as soon as it is due.
        first_tick = self._last_now + self._timer.time_until_next_call() / SECOND
        self._epoch_ns = CLOCK_START_NS if params.publish_clock else round(first_tick * SECOND)
        self._timeline = Timeline(params.rate, params.real_time_factor, first_tick)
        self._next_clock = -math.inf

    def _tick(self) -> None:
        now = self._now()
        if not 0.0 <= now - self._last_now <= CLOCK_JUMP:  # the clock that this node follows was set, or begins
            self._follow(now)
        self._last_now = now
        if self._failure or (self._paused and self._clock_publisher):  # simulated time stands still
            self._timeline.restart_clock(now)
            return
        for topic, age in self._commands.items():
            if age.seconds > self._settings.value.command_timeout:
                self._obey(topic, 0.0)
        reached = self._timeline.reached(now)
        end = time.monotonic() + BURST_SECONDS
        for _ in range(self._burst()):
            if self._timeline.due > reached or self._failure or time.monotonic() >= end:
                break
            self._publish()
        if not self._paused and self._period() <= PREPARE_WITHIN:
            with suppress(MotionError):  # told when the sample is due
                self._rig.prepare(self._timeline.rig_time)

    def _publish(self) -> None:
        timeline = self._timeline
        due = timeline.due
        stamp_ns = self._epoch_ns + round(due * SECOND)
        try:
            sample = self._rig.read(timeline.rig_time, stamp_ns, self._paused)
        except MotionError as error:
            self._failure = str(error)
            self._report()
            self.get_logger().error(f'stopped: {error}; ~/reset starts again')
            return
        if self._clock_publisher and due >= self._next_clock:
            self._clock_publisher.publish(ClockMessage(clock=to_stamp(stamp_ns)))
            self._next_clock = due + 1.0 / CLOCK_RATE - 1e-9
        if not self._announced:
            self._announced = True
            self._runs.publish(run_message(stamp_ns, self._run))
        if sample:
            self._joint_states.publish(self._writer.write(sample))
            if self._person_force:
                self._person_force.publish(wrench_bytes(stamp_ns, -sample.coupler.force))
        timeline.step(self._paused)

    def _configure(self, params: SimulatorParams) -> None:
        self._rig.params = params
        self._timeline.configure(params.rate, params.real_time_factor, self._now())
        self._timer.timer_period_ns = round(self._period() * SECOND)

    def _on_command(self, topic: Topic, message: Any, age: float) -> None:
        if age > self._settings.value.command_timeout:  # it waited here while this process could not run
            return
        try:
            self._obey(topic, message.data)
        except ValueError as error:
            self._refused_commands += 1
            self.get_logger().warning(f'{topic.name}: {error}', throttle_duration_sec=1.0)
            return
        self._commands[topic].renew(age)

    def _obey(self, topic: Topic, value: float) -> None:
        """Let a command act on the rig from now on."""
        if topic is REAR_TORQUE_COMMAND:
            self._rig.rear_torque = value
        else:
            self._rig.simulation.external_force = value

    def _on_reset(self, request: Any, response: Any) -> Any:
        try:
            self._rig.reset()
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        self._failure = ''
        self._run, self._announced = self._run + 1, False
        self._restart()
        self._report()
        response.success, response.message = True, 'the wheels are back at their start'
        return response

    def _on_pause(self, request: Any, response: Any) -> Any:
        self._paused = request.data
        self._report()
        response.success, response.message = True, 'paused' if request.data else 'running'
        return response

    def _diagnose(self) -> Diagnosis:
        simulation = self._rig.simulation
        standing = [name for name, stands in zip((FRONT, REAR), simulation.standing, strict=True) if stands]
        level, state, message = Level.OK, SourceState.RUNNING, 'running'
        if self._failure:
            level, state, message = Level.ERROR, SourceState.FAILED, self._failure
        elif self._paused:
            state, message = SourceState.PAUSED, 'paused: the wheels are held'
        elif standing:
            level, state = Level.WARN, SourceState.STANDING
            message = f'the {" and the ".join(standing)} wheel stands still on two spokes'
        behind = self._timeline.reached(self._now()) - self._timeline.due
        return Diagnosis(
            level,
            message,
            {
                STATE: state,
                'simulated time [s]': simulation.time,
                'behind the pace [s]': max(behind, 0.0),
                STEP_DIFFERENCE: simulation.steps[0] - simulation.steps[1],
                'external force [N]': simulation.external_force,
                'rear torque [N·m]': self._rig.rear_torque,
                'commands refused': self._refused_commands,
            },
        )


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run('simulator', SimulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
