"""What a script needs: rigs, trials in simulation, the return map, sweeps, designs and recorded trials. No ROS needed.

Everything here is also a name of the package: ``import dcdrw; dcdrw.simulate(dcdrw.preset('paper'), phase=0.216)``.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dcdrw.recordings.joint_batch import JointBatch
from dcdrw.suite.parameter_file import TrialParams, read_parameter_file
from dcdrw.trials.analysis import Analysis
from dcdrw.trials.analysis import analyze as _analyze
from dcdrw.trials.figure import draw_trial
from dcdrw.trials.motion import Whole
from dcdrw.trials.results import read_trial
from dcdrw.trials.summary import Summary, summarize
from dcdrw_msgs_py.rig import RigParams, WheelParams
from dcdrw_msgs_py.samples import SECOND, JointSample
from dcdrw_msgs_py.topics import COUPLER, FRONT_WHEEL, REAR_WHEEL
from dcdrw_sim.map.return_map import ReturnMap
from dcdrw_sim.model.presets import PRESETS, preset
from dcdrw_sim.model.start import Start, start
from dcdrw_sim.rig.simulator import SimulatedRig, SimulatorParams
from dcdrw_sim.study.design import Assessment, Task, assess, search
from dcdrw_sim.study.sweep import Axis, Sweep, check_sweep, compute, default_axis, default_seconds
from dcdrw_sim.study.sweep_dataset import to_dataset

__all__ = [
    'PRESETS',
    'Assessment',
    'Axis',
    'ReturnMap',
    'RigParams',
    'Start',
    'Trial',
    'WheelParams',
    'analyze',
    'design',
    'preset',
    'read_rig',
    'return_map',
    'simulate',
    'start',
    'sweep',
]


class Trial(NamedTuple):
    """A trial, simulated or recorded, as the suite's estimator and monitor judge it."""

    analysis: Analysis
    """Every sample, strike and error: ``analysis.motion`` has columns of one length, among them θ1, θ2 and φ in rad."""
    summary: Summary
    """The verdict: what `dcdrw trial` writes into summary.json."""

    @property
    def steps(self) -> int | None:
        """Steps to synchronization (contract §2); None where the pair does not come into step."""
        return self.summary.steps_to_synchronization

    def plot(self, path: str | Path, title: str = '') -> None:
        """Draw θ1, θ2, the phase in its band, the gait and the coupler's force against time; needs matplotlib.

        Raises:
            ValueError: matplotlib is missing.
            OSError: the file cannot be written.

        """
        draw_trial(self.analysis, title, Path(path))


def read_rig(path: str | Path) -> RigParams:
    """The rig of a parameter file, as config/rig.yaml.

    Raises:
        ValueError: it is not such a file; the key that is wrong is named.
        OSError: it cannot be read.

    """
    return read_parameter_file(Path(path), TrialParams()).rig


def simulate(
    rig: RigParams | None = None,
    phase: float = 0.216,
    seconds: float = 30.0,
    rate: float = 1000.0,
    noise_deg: float = 0.0,
    seed: int = 0,
) -> Trial:
    """Run a trial in simulation, and judge it as `dcdrw trial` does, without its nodes.

    Args:
        rig: by default the paper's.
        phase: p0 in [0, 1) at the start, just after a strike of the front wheel; 0.5 is the goal.
        seconds: how long [s].
        rate: samples per second [Hz].
        noise_deg: noise of the encoders, one standard deviation [°].
        seed: of the noise.

    Raises:
        ValueError: an impossible rig, phase or rate, or a slope on which the wheels do not roll by themselves.

    """
    rig = rig or preset('paper')
    if not 0.0 <= phase < 1.0:
        raise ValueError(f'phase must be in [0, 1) of a step, got {phase:g}; for {phase:g} % give {phase / 100:g}')
    settings = SimulatorParams(rate=rate, initial_phase_percent=100.0 * phase, noise_deg=noise_deg, seed=seed)
    simulated = SimulatedRig(rig, settings)
    samples = [simulated.read(i / rate, SECOND + round(i / rate * SECOND)) for i in range(round(seconds * rate) + 1)]
    whole = Whole()
    analysis = _analyze(_batches([sample for sample in samples if sample]), TrialParams.of_rig(rig), [whole])
    return Trial(analysis._replace(motion=whole.motion), summarize(analysis))


def _batches(samples: list[JointSample]) -> Iterator[JointBatch]:
    turns = [(sample.front, sample.rear, sample.coupler) for sample in samples]
    yield JointBatch(
        '',
        (FRONT_WHEEL, REAR_WHEEL, COUPLER),
        np.array([sample.stamp_ns for sample in samples], np.int64),
        np.array([(front.angle, rear.angle, coupler.length) for front, rear, coupler in turns]),
        np.array([(front.rate, rear.rate, coupler.rate) for front, rear, coupler in turns]),
        np.array([(np.nan, np.nan, coupler.force) for _, _, coupler in turns]),
    )


def analyze(path: str | Path, rig: str | Path | None = None) -> Trial:
    """Judge a recorded trial: a folder of `dcdrw trial` or of `ros2 bag record` (MCAP or sqlite3).

    Args:
        path: the recording, or the trial's folder.
        rig: a parameter file; what it names takes the place of what was recorded.

    Raises:
        ValueError: no recording, or no joint states that can be read; or mcap or rosbags is missing.
        OSError: a file cannot be read.

    """
    whole = Whole()
    analysis, _ = read_trial(Path(path), rig=Path(rig) if rig else None, sinks=[whole])
    return Trial(analysis._replace(motion=whole.motion), summarize(analysis))


def return_map(rig: RigParams | None = None) -> ReturnMap:
    """The map from one strike of the front wheel to the next, with its fixed point and multipliers.

    Args:
        rig: by default the paper's.

    Raises:
        ValueError: an impossible rig, or wheels of different step lengths.

    """
    return ReturnMap(rig or preset('paper'))


def sweep(
    rig: RigParams | None = None,
    x: str | Axis = 'k',
    y: str | Axis = 'b',
    seconds: float | None = None,
    trajectories: bool = False,
) -> Any:
    """Judge a rig over any two of its parameters, from nine starts at each point, as an xarray Dataset.

    Args:
        rig: what all points share; by default the paper's sweep (m = ℓ = g = 1 on 1.75°).
        x: an axis, or its text NAME:LOW:HIGH:COUNT[:log]; 'k' and 'b' alone mean the paper's range.
        y: likewise.
        seconds: how long to simulate; by default 200 √(ℓ/g), the paper's.
        trajectories: keep the states at each section, which the paper's figures show.

    Raises:
        ValueError: an impossible axis or rig, or xarray is missing.

    """
    rig = rig or preset('paper-sweep')
    asked = Sweep(rig, _axis(x, rig), _axis(y, rig), seconds or default_seconds(rig), trajectories=trajectories)
    check_sweep(asked)
    along_x, along_y = asked.shape
    return to_dataset(asked, compute(asked, (slice(0, along_x), slice(0, along_y))))


def _axis(axis: str | Axis, rig: RigParams) -> Axis:
    if isinstance(axis, Axis):
        return axis
    return Axis.parse(axis) if ':' in axis else default_axis(axis, rig)


def design(
    rig: RigParams | None = None,
    k: tuple[float, float] | None = None,
    b: tuple[float, float] | None = None,
    seconds: float = 60.0,
) -> dict[str, Assessment]:
    """The couplers that bring a rig into step in the fewest steps: `fastest`, and `forgiving` where things are off.

    Args:
        rig: by default the paper's; its own k and b do not matter.
        k: least and greatest stiffness to look at [N/m]; by default the paper's range in the rig's units.
        b: likewise, damping [N·s/m].
        seconds: how long a trial may last [s].

    Raises:
        ValueError: an impossible rig, or a slope on which the wheels do not roll by themselves.

    """
    rig = rig or preset('paper')
    task = Task(rig, seconds)
    found = search(task, k or _ends(default_axis('k', rig)), b or _ends(default_axis('b', rig)))
    return {name: assess(task, *getattr(found, name)) for name in ('fastest', 'forgiving')}


def _ends(axis: Axis) -> tuple[float, float]:
    return axis.values[0], axis.values[-1]
