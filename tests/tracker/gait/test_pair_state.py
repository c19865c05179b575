"""One judge of what the pair does, with one order of precedence (contract §7)."""

from itertools import product

import pytest

from dcdrw_msgs_py.diagnosis import PairState
from dcdrw_tracker.gait.pair_state import judge
from dcdrw_tracker.gait.sync import SyncStatus

ORDER = ('no_data', 'held', 'stalled', 'slipped', 'lost', 'synchronized', 'converging')


def test_the_states_are_those_of_the_contract_in_its_order() -> None:
    assert tuple(state.value for state in PairState) == ORDER


@pytest.mark.parametrize('holds', list(product([False, True], repeat=6)))
def test_the_first_state_that_holds_counts(holds: tuple[bool, ...]) -> None:
    no_data, held, stalled, slipped, lost, synchronized = holds
    status = SyncStatus(
        stamp_ns=1,
        held=held,
        stalled=('front',) if stalled else (),
        slipped=slipped,
        lost=lost,
        synchronized=synchronized,
    )
    first = (*holds, True).index(True)
    assert judge(status, fresh=not no_data).value == ORDER[first]


def test_without_a_sample_there_are_no_data() -> None:
    assert judge(SyncStatus()) is PairState.NO_DATA
