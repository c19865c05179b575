# %% [markdown]
# # A controller on the phase
#
# For a control engineer: the pair as a plant, a law that holds a force from strike to strike, the loop closed in a
# script, and then the node that does it. No ROS is needed up to there.

# %%
import numpy as np

import dcdrw
from dcdrw_control.sync.hold import HoldGains, HoldLaw
from dcdrw_msgs_py.samples import JointSample, Turn
from dcdrw_sim.map.holding import law, margins, plant
from dcdrw_sim.motion.pair import Simulation
from dcdrw_tracker.gait.phase import PhaseEstimator, PhaseParams

RATE, LIMIT = 500.0, 20.0  # Hz, N

# %% [markdown]
# ## The plant
#
# From one strike of the front wheel to the next, with a force u held in the coupler, a small deviation x of [θ1′, θ2,
# θ2′] from the limit cycle becomes x⁺ = A x + B u. A and B are exact derivatives of the return map. The largest
# multiplier of the paper's coupler is 0.94: it halves an error in eleven steps.

# %%
rig = dcdrw.preset('paper')
found = plant(rig)
print('A =', found.point.derivative.round(3).tolist())
print('B =', found.by_new.round(5).tolist())
print('multipliers without a law:', np.abs(found.point.multipliers).round(4))

# %% [markdown]
# ## The law
#
# Deadbeat on θ2: the force that puts θ2 on its aim after one step. About the limit cycle it needs no power, for a
# constant force does no net work in a periodic gait.

# %%
chosen = law(found, 'deadbeat')
edges = margins(found, chosen)
print('multipliers with it:', np.abs(found.closed(chosen)).round(4))
print(f'unstable from {edges.gain:.2f} times this gain on, and from {edges.delay:.2f} s of delay on')

# %% [markdown]
# ## The loop
#
# The simulated pair, the suite's own phase estimator, and the law's core: what the nodes do, in one loop. A law of
# your own takes the place of `HoldLaw`: `update` gets a phase sample, and returns a force.


# %%
def closed_loop(phase, controller, seconds=10.0):
    """Percent of a step by which the phase is off, and force [N], at RATE."""
    begun = dcdrw.start(rig, phase)
    pair, estimator = Simulation(*begun), PhaseEstimator(PhaseParams())
    rows = []
    for tick in range(round(seconds * RATE)):
        motion = pair.advance_to(tick / RATE)
        joints = JointSample(
            round(tick / RATE * 1e9) + 1, Turn(motion.rotation1, motion.omega1), Turn(motion.rotation2, motion.omega2)
        )
        sample = estimator.update(joints).phase
        force = controller.update(sample) if controller and sample else 0.0
        pair.external_force = float(np.clip(np.nan_to_num(force), -LIMIT, LIMIT))
        turned = motion.rotation1 / (2 * rig.front.alpha) - motion.rotation2 / (2 * rig.rear.alpha)
        rows.append((100.0 * (turned % 1.0 - 0.5), pair.external_force))
    return np.array(rows)


gains = HoldGains(tuple(chosen.state), tuple(chosen.gain), chosen.force, chosen.gain_before, chosen.middle)
for phase in (0.1, 0.216, 0.7):
    for name, controller in (('passive', None), ('deadbeat', HoldLaw(gains, rig.front.alpha, rig.rear.alpha))):
        rows = closed_loop(phase, controller)
        outside = np.flatnonzero(np.abs(rows[:, 0]) > 6.0)[-1] / RATE
        most = np.abs(rows[:, 1]).max()
        print(f'{name:9} from {phase:.1%}: outside ±6 % until {outside:4.1f} s, at most {most:.1f} N')
        assert controller is None or outside < 2.5

# %% [markdown]
# ## The node
#
# `dcdrw control --rig my_rig.yaml --out gains.yaml` computes the same gains for your rig, and `synchronizer` does the
# rest: bounds on force, slew and power, a heartbeat, and a state machine that ends in zero force whatever fails.
#
#     dcdrw control --rig my_rig.yaml --out gains.yaml
#     # needs a ROS 2; in .venv: synchronizer --ros-args ...
#     ros2 run dcdrw synchronizer --ros-args --params-file gains.yaml
#     ros2 topic pub --rate 20 /enable std_msgs/msg/Bool '{data: true}'
#
# [For the control engineer](../xrl.md) has topics, units, rates and what each failure does.
