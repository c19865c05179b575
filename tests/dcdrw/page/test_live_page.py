"""The live page in Chromium, against real nodes."""

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.parameter import parameter_value_to_python

from dcdrw.page.live_state import LATE_DATA
from dcdrw.suite.hub_gains import hub_gains
from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_msgs_py.messages import stamp_ns
from dcdrw_msgs_py.rig import RigParams
from dcdrw_msgs_py.topics import JOINT_STATES, PHASE_STATE, SYNCHRONIZER_STATE
from dcdrw_msgs_py.topics import SYNCHRONIZED as VERDICT
from tests import ROOT
from tests.bench import Bench
from tests.children import nodes, runs
from tests.chromium import Chromium, Tab
from tests.patience import PATIENCE

pytestmark = pytest.mark.processes

STIFF = {'k': 60.0, 'rate': 100.0, 'initial_phase_percent': 30.0}
STATE = 'document.body.dataset.state'
OLD = "document.body.classList.contains('old')"
LATE_PAGE = 'late_page'
RIG = "JSON.stringify(document.getElementById('rig-canvas').dataset)"
RIGHT_ARROW, HOME = ('ArrowRight', 39), ('Home', 36)


@pytest.fixture(scope='module')
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    browser = Chromium(tmp_path_factory.mktemp('chromium'))
    yield browser
    browser.close()


@pytest.fixture
def live(bench: Bench) -> Iterator['Live']:
    live = Live({'ROS_DOMAIN_ID': str(bench.domain)})
    yield live
    live.close()


class Live:
    """`dcdrw live` as a process; it starts again at the same port."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = {**os.environ, 'PYTHONPATH': str(ROOT), **environment}
        self._processes: list[subprocess.Popen[str]] = []
        self._port = '0'

    def start(self, *arguments: str) -> str:
        """Start, and return the address."""
        process = subprocess.Popen(
            [sys.executable, '-m', 'dcdrw.cli', 'live', '--port', self._port, *arguments],
            env=self._environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._processes.append(process)
        assert process.stdout
        told = next(line for line in process.stdout if line.startswith('Live at'))
        address = told.split()[2]
        self._port = address.split(':')[2].split('/')[0]
        return address

    def end(self, number: int = signal.SIGINT) -> int:
        self._processes[-1].send_signal(number)
        return self._processes[-1].wait(PATIENCE)

    def close(self) -> None:
        for process in self._processes:
            if process.poll() is None:
                process.kill()
            process.wait()
            assert process.stdout
            process.stdout.close()


def start_nodes(bench: Bench, **parameters: Any) -> None:
    bench.start('sync_monitor')
    bench.start('phase_estimator')
    bench.start('simulator', **{**STIFF, **parameters})


def text(tab: Tab, name: str) -> str:
    return str(tab.value(f"document.getElementById('{name}').textContent"))


def drawn(tab: Tab) -> dict[str, Any]:
    return dict(json.loads(tab.value(RIG)))


def heard(bench: Bench, stamp: int, messages: list[Any]) -> Any:
    """The message of a stamp; None where the bench has lost it, or has come too late for it."""
    bench.wait(lambda: messages and stamp_ns(messages[-1].header.stamp) >= stamp, 'what was drawn')
    return next((message for message in reversed(messages) if stamp_ns(message.header.stamp) == stamp), None)


def parameter(bench: Bench, name: str) -> Any:
    answer = bench.call(GetParameters, '/simulator/get_parameters', GetParameters.Request(names=[name]))
    return parameter_value_to_python(answer.values[0])


def test_what_is_drawn_follows_the_data(bench, live, chromium, live_trial):
    phases, joints, verdicts = bench.hear(PHASE_STATE), bench.hear(JOINT_STATES), bench.hear(VERDICT)
    start_nodes(bench)
    token = 'known-to-this-browser'
    address = live.start('--token', token, '--over', str(live_trial), str(live_trial))
    tab = chromium.tab(address)
    assert tab.value('location.search') == '', 'the token is no longer in the address'
    # The topics are found one after the other; without the coupler's length the feet are the footfalls' guess.
    tab.wait("document.getElementById('force-canvas').dataset.points > 10")
    seen, unheard = 0, 0
    while seen < 15:  # what is drawn is what the topics said at its stamp
        now = bench.wait(lambda: drawn(tab).get('stampNs') and drawn(tab), 'a drawing')
        phase, joint = (heard(bench, int(now['stampNs']), messages) for messages in (phases, joints))
        if phase is None or joint is None:
            unheard += 1
            assert unheard < 10
            continue
        seen += 1
        angles = dict(zip(phase.name, phase.position, strict=True))
        assert float(now['theta1']) == pytest.approx(angles['front_stance'], abs=1e-4)
        assert float(now['theta2']) == pytest.approx(angles['rear_stance'], abs=1e-4)
        assert int(now['n']) == angles['step_difference']
        assert float(now['hubs']) == pytest.approx(joint.position[list(joint.name).index('coupler')], abs=1e-3)
    tab.wait(f'{STATE} === "{PairState.SYNCHRONIZED.value}"')
    bench.wait(lambda: verdicts and verdicts[-1].data, 'the verdict')
    tab.wait("document.getElementById('detail').textContent.startsWith('synchronized after')")
    tab.wait("document.getElementById('errors-canvas').dataset.shown >= 5")
    tab.wait("document.getElementById('gait-canvas').dataset.falls >= 10")
    for canvas in ('phi', 'force'):
        tab.wait(f"document.getElementById('{canvas}-canvas').dataset.points > 100")
    assert abs(float(text(tab, 'error').replace('−', '-').removesuffix(' %'))) < 10.0
    tab.wait("document.querySelectorAll('#nodes .name').length === 3")
    tab.open(address.split('?')[0])  # the cookie is enough
    tab.wait(f'{STATE} === "{PairState.SYNCHRONIZED.value}"')
    tab.wait("document.getElementById('phi-canvas').dataset.points > 100")
    tab.value("document.getElementById('reset').click()")  # a new start, beneath which the earlier trial lies
    tab.wait("document.getElementById('over').textContent.endsWith('beneath')")
    tab.wait("document.getElementById('phi-canvas').dataset.over > 10")
    assert text(tab, 'choice') == 'no earlier trial' + 2 * live_trial.name
    choose = "document.getElementById('choice').value = {}; document.getElementById('choice').onchange()"
    tab.value(choose.format(-1))
    tab.wait("document.getElementById('phi-canvas').dataset.over == 0")
    tab.value(choose.format(1))
    tab.wait("document.getElementById('phi-canvas').dataset.over > 10")
    # A curve breaks where more than three of its usual steps are missing, and nowhere else.
    times = [0.02 * i for i in range(100) if i != 10 and not 30 < i < 36 and not 60 < i < 70]
    tab.value("import('/charts.js').then((charts) => { window.charts = charts; })")
    tab.wait('window.charts')
    pieces = tab.value(f'[...charts.pieces({[[t, 0.0] for t in times]}, () => false)].map((piece) => piece.length)')
    assert pieces == [30, 25, 30]
    assert tab.complaints == []
    assert live.end() == 0


def test_sliders_and_buttons_act_through_the_nodes(bench, live, chromium, tmp_path):
    joints = bench.hear(JOINT_STATES)
    start_nodes(bench, k=5.25)
    tab = chromium.tab(live.start())
    tab.wait("document.getElementById('k-range')?.disabled === false")
    assert tab.value("document.getElementById('k-field').valueAsNumber") == 5.25
    assert tab.value("document.getElementById('record').disabled")
    assert 'No recorder runs here' in text(tab, 'hint')

    tab.value("document.getElementById('k-range').focus()")
    tab.press(*HOME)
    for _ in range(3):
        tab.press(*RIGHT_ARROW)
    asked = tab.value("document.getElementById('k-range').valueAsNumber")
    assert asked > 0.0
    bench.wait(lambda: parameter(bench, 'k') == pytest.approx(asked), 'the slider in the simulator')
    enter(tab, 'slope', 3.0)
    bench.wait(lambda: parameter(bench, 'slope') == pytest.approx(math.radians(3.0)), 'the slope in the simulator')
    tab.wait("document.getElementById('slope').textContent === 'on a slope of 3.00°'")
    enter(tab, 'b', 900.0)  # beyond the slider, which widens
    bench.wait(lambda: parameter(bench, 'b') == 900.0, 'b in the simulator')
    assert tab.value("document.getElementById('b-range').valueAsNumber") == 900.0
    enter(tab, 'k', -5.0)  # impossible: the field itself says so
    assert tab.value("document.getElementById('k-field').validity.rangeUnderflow")
    assert parameter(bench, 'k') == pytest.approx(asked)

    click(tab, 'pause')
    bench.wait(lambda: joints[-1].velocity[0] == 0.0, 'a pause')
    tab.wait("document.getElementById('pause').textContent === 'Go on'")
    tab.wait(f'{STATE} === "{PairState.HELD.value}"')
    bench.spin(4.0)  # longer than a wheel may take for a step
    assert tab.value(STATE) == PairState.HELD.value
    click(tab, 'pause')
    bench.wait(lambda: joints[-1].velocity[0] > 0.0, 'the end of the pause')
    turned = joints[-1].position[0]
    click(tab, 'reset')
    bench.wait(lambda: joints[-1].position[0] < turned, 'the reset')
    tab.wait("document.getElementById('notice').textContent === 'the wheels are back at their start'")

    bench.start('recorder', folder=tmp_path / 'recording')
    tab.wait("document.getElementById('record').disabled === false")
    click(tab, 'record')
    tab.wait("document.getElementById('record').getAttribute('aria-pressed') === 'true'")
    click(tab, 'record')
    tab.wait("document.getElementById('record').getAttribute('aria-pressed') === 'false'")
    assert (tmp_path / 'recording' / 'metadata.yaml').exists()
    assert tab.complaints == []


def test_the_synchronizer_is_enabled_and_stopped_from_the_page_where_that_is_allowed(bench, live, chromium):
    states = bench.hear(SYNCHRONIZER_STATE)
    gains = {f'hub.{name}': value for name, value in hub_gains(RigParams(k=16.0, b=10.0))._asdict().items()}
    gains['hub.free_speeds'] = list(gains['hub.free_speeds'])
    bench.start('synchronizer', law='rear', **gains)
    start_nodes(bench, k=16.0, b=10.0, person__walks=True)
    tab = chromium.tab(live.start('--allow-enable'))
    tab.wait("!document.getElementById('acting').hidden && document.getElementById('acts').textContent === 'disabled'")
    tab.wait("document.getElementById('person').textContent.includes('on the person at most')")
    click(tab, 'enable')
    assert text(tab, 'enable') == 'Really let it push?'
    bench.wait(lambda: states, 'the state of the synchronizer')
    bench.spin(0.5)
    assert states[-1].data == 'disabled', 'one touch only asks'

    def pushes() -> bool:
        if text(tab, 'enable') in ('Enable', 'Really let it push?'):  # asked anew where nobody answered in time
            click(tab, 'enable')
        return 'active' in [state.data for state in states]

    bench.wait(pushes, 'the synchronizer to push')
    click(tab, 'stop')
    bench.wait(lambda: states[-1].data in ('disabled', 'fault'), 'the stop')
    assert text(tab, 'enable') == 'Enable'
    assert tab.complaints == []


def click(tab: Tab, name: str) -> None:
    """Press a button, as soon as it can be pressed."""
    button = f"document.getElementById('{name}')"
    tab.wait(f'(() => {{ const can = !{button}.disabled; if (can) {button}.click(); return can; }})()')


def enter(tab: Tab, name: str, value: float) -> None:
    tab.value(
        f"(() => {{ const field = document.getElementById('{name}-field'); field.value = {value}; "
        "field.dispatchEvent(new Event('change')); })()"
    )


def test_page_outlives_nodes_servers_and_sleep(bench, live, chromium):
    bench.start('sync_monitor')
    bench.start('phase_estimator')
    simulator = bench.start('simulator', **STIFF)
    address = live.start()
    tab, phone = chromium.tab(address), chromium.tab(address, 390, 844, dark=True)
    for one in (tab, phone):
        one.wait(f'!{OLD}')
    assert phone.value('document.documentElement.scrollWidth') == 390, 'nothing is cut off'

    phone.send('Page.setWebLifecycleState', state='frozen')
    bench.end(simulator, signal.SIGKILL)
    tab.wait(f'{STATE} === "{LATE_DATA}"')
    assert tab.value(OLD)
    assert 'nothing has come for' in text(tab, 'detail')
    assert float(text(tab, 'age').split()[4]) > 1.0
    assert text(tab, 'phi') != '–', 'what came last stays, greyed'
    bench.start('simulator', **STIFF)
    tab.wait(f'!{OLD}')
    phone.send('Page.setWebLifecycleState', state='active')
    phone.wait(f'!{OLD}')
    for one in (tab, phone):  # only what is seen is drawn, and Chromium forgets who that is while one is frozen
        one.send('Page.bringToFront')
    before = int(drawn(phone)['stampNs'])
    phone.wait(RIG, lambda rig: int(json.loads(rig)['stampNs']) > before)
    passes(phone, 'pagehide')  # as a page that its browser keeps for the back button
    phone.wait(f'{STATE} === "{LATE_PAGE}"')
    passes(phone, 'pageshow')
    phone.wait(f'!{OLD}')
    assert tab.complaints == phone.complaints == []

    live.end(signal.SIGKILL)
    tab.wait(f'{STATE} === "{LATE_PAGE}"')
    assert tab.value(OLD)
    assert 'hears nothing of dcdrw live' in text(tab, 'detail')
    assert tab.value("document.getElementById('reset').disabled")
    assert text(tab, 'hint') == '', 'nobody knows what runs'
    assert tab.value("+getComputedStyle(document.getElementById('nodes')).opacity") < 0.5, 'nor what the nodes say now'
    live.start()
    for one in (tab, phone):
        one.wait(f'!{OLD}')
        # That its server was away is all that the browser itself has to say.
        assert all('WebSocket connection' in complaint for complaint in one.complaints)


def passes(tab: Tab, event: str) -> None:
    tab.value(f"dispatchEvent(new PageTransitionEvent('{event}', {{persisted: true}}))")


def test_trial_starts_the_nodes_and_lets_the_wheels_go(chromium):
    live = Live({})
    try:
        tab = chromium.tab(live.start('--trial'))
        tab.wait("Number(document.getElementById('errors-canvas').dataset.steps) > 0")
        tab.wait("document.querySelectorAll('#nodes .name').length === 4")
        assert tab.complaints == []
        started = nodes(live._processes[-1].pid)
        assert len(started) == 4
        assert live.end() == 0
        assert not any(map(runs, started))
    finally:
        live.close()
