import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests import ROOT
from tests.patience import PATIENCE
from tests.trials import FIRST, STIFF

if TYPE_CHECKING:
    from tests.bench import Bench

# A busy machine is not a counterexample.
settings.register_profile('patient', deadline=None)
settings.load_profile('patient')

# On a busy machine, and beside killed processes, Fast DDS makes its ports in shared memory anew, and then crashes
# when a participant ends (SharedMemChannelResource::release). The range LOCALHOST always brings shared memory: tests
# keep to this machine by a profile of their own.
os.environ.update(
    ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET', FASTRTPS_DEFAULT_PROFILES_FILE=str(ROOT / 'tests' / 'data' / 'loopback.xml')
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes longest comes first: nobody waits for it in the end."""
    items.sort(key=lambda item: 'test_commands_of_a_page_run' not in item.name)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator['Bench']:
    from tests.bench import Bench  # here, so that the cores are tested without ROS

    bench = Bench(tmp_path)
    yield bench
    bench.close()


@pytest.fixture(scope='session')
def live_trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a trial that was run live: 200 Hz, in step within its 5 s."""
    folder = tmp_path_factory.mktemp('trial')
    (folder / 'my_rig.yaml').write_text(STIFF)
    subprocess.run(
        [
            sys.executable,
            '-m',
            'dcdrw.cli',
            *FIRST.split()[1:],
            '--initial-phase',
            '35',
            '--seconds',
            '5',
            '--note',
            'first: "with" new springs',
            '--quiet',
        ],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        check=True,
        timeout=PATIENCE,
        stdout=subprocess.DEVNULL,
    )
    return folder / 'trials' / 'first'
