"""The package's own names: what a script gets from `import dcdrw`."""

import subprocess
import sys

import pytest

import dcdrw
from dcdrw import api
from tests import ROOT


def test_the_package_has_the_names_of_its_api_and_no_other():
    assert dcdrw.__all__ == api.__all__
    assert all(getattr(dcdrw, name) is getattr(api, name) for name in api.__all__)
    with pytest.raises(AttributeError, match='no attribute'):
        dcdrw.simulat  # noqa: B018


def test_importing_the_package_imports_nothing_heavy():
    code = 'import sys, dcdrw; assert not {"numpy", "scipy", "rclpy"} & set(sys.modules)'
    subprocess.run([sys.executable, '-c', code], check=True, cwd=ROOT)


def test_the_natural_call_gives_the_trials_answer():
    trial = dcdrw.simulate(phase=0.216)
    assert trial.steps == 38
    assert trial.summary.initial_phase_percent == pytest.approx(21.6, abs=0.1)
    assert dcdrw.simulate(phase=0.216, seconds=3.0).steps is None


def test_a_phase_in_percent_is_asked_about():
    with pytest.raises(ValueError, match=r'for 21\.6 % give 0\.216'):
        dcdrw.simulate(phase=21.6)


def test_a_trial_draws_itself(tmp_path):
    pytest.importorskip('matplotlib')
    dcdrw.simulate(seconds=4.0, rate=200.0).plot(tmp_path / 'trial.png', 'four seconds')
    assert (tmp_path / 'trial.png').stat().st_size > 10_000
