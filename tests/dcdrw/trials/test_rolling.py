"""Tables of encoders as people have them: read, or refused with the line."""

import math

import numpy as np
import pytest

from dcdrw.trials.rolling import table_samples
from dcdrw_msgs_py.rig import RigParams
from tests.tracker.walking import walk

TRUTH = walk(8.0, 100.0)
TABLE = 'time,psi1,psi2\n' + ''.join(
    f'{time},{front},{rear}\n' for time, front, rear in zip(TRUTH.time, TRUTH.front, TRUTH.rear, strict=True)
)
IN_DEGREES = 'time [ms],psi1 [deg],psi2_deg\n' + ''.join(
    f'{1e3 * time},{math.degrees(front)},{math.degrees(rear)}\n'
    for time, front, rear in zip(TRUTH.time, TRUTH.front, TRUTH.rear, strict=True)
)
WRAPPED = 'time,psi1,psi2\n' + ''.join(
    f'{time},{front},{math.remainder(rear, math.tau)}\n'
    for time, front, rear in zip(TRUTH.time, TRUTH.front, TRUTH.rear, strict=True)
)


@pytest.mark.parametrize(
    'content',
    [
        TABLE.encode(),
        b'\xef\xbb\xbf' + TABLE.encode(),
        TABLE.replace('\n', '\r\n').encode(),
        TABLE.replace('\n', ',\n').encode(),
        TABLE.replace('\n', '\n\n').encode(),
        TABLE.replace('time,psi1,psi2', '"time","psi1","psi2"').encode(),
        TABLE.encode('utf-16'),
        TABLE.replace(',', '\t').encode(),
        TABLE.replace(',', ';').replace('.', ',').encode(),
        b'# encoders\n' + TABLE.replace('time,psi1,psi2', 'Time [s],Psi1 (rad),psi2').encode(),
        IN_DEGREES.encode(),
    ],
    ids=[
        *('plain', 'bom', 'crlf', 'trailing commas', 'blank lines', 'quotes', 'utf-16', 'tabs', 'semicolons'),
        *('remarks and units', 'other units'),
    ],
)
def test_a_table_is_read_as_spreadsheets_write_it(content, tmp_path):
    (tmp_path / 'table.csv').write_bytes(content)
    samples = table_samples(tmp_path / 'table.csv', RigParams())
    assert len(samples.seconds) == pytest.approx(800, abs=5)
    assert samples.seconds[-1] == pytest.approx(8.0, abs=0.1)
    assert np.ptp(samples.rotations[:, 0]) == pytest.approx(np.ptp(TRUTH.front), rel=0.02)


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (TABLE.replace(',', ' ').encode(), 'must have columns time, psi1, psi2'),
        (TABLE.replace(',', ';').encode() + b'9;"1,5";1', "line 802: '1,5' is not a number"),
        (b'time,psi1,psi1,psi2\n0,0,0,0\n', 'has the columns psi1 and psi1: leave one'),
        (b'time,psi1,psi1_deg,psi2\n0,0,0,0\n', 'has the columns psi1 and psi1_deg: leave one'),
        (b'time,psi1 [turns],psi2\n0,0,0\n', "column psi1: 'turns' is not a unit like rad; known are rad, deg, °"),
        (IN_DEGREES.replace('[ms]', '').encode(), '10 s lie between one sample and the next'),
        (TABLE.replace('time', 'stamp_ns').encode(), '1e-11 s lie between one sample and the next'),
        (IN_DEGREES.replace('[deg]', '').replace('_deg', '').encode(), 'are psi1 and psi2 in degrees?'),
        (WRAPPED.encode(), 'psi2 jumps by whole turns, as an encoder that begins anew with each: unwrap it'),
        (b'time,psi1,psi2\n0,0,0\n0.1,0,0\n', 'both wheels roll in'),
        (b'time,psi1,psi2\n0,0,\n0.1,0,\n', 'both wheels roll in 0 samples'),
        (TABLE.encode() + b'9,inf,1\n', "line 802: 'inf' is not a number"),
        (TABLE.encode() + b'9,1e400,1\n', "line 802: '1e400' is not a number"),
        (TABLE.encode() + b'1_0,1,1\n', "line 802: '1_0' is not a number"),
        (TABLE.encode() + b'9,n/a,1\n', "line 802: 'n/a' is not a number"),
        (TABLE.encode() + b'nan,1,1\n', 'line 802: time must go on'),
        (TABLE.encode() + b'1,1,1\n', 'line 802: time must go on'),
        (b'time,psi1,psi2\n', 'has no samples'),
        (b'', 'must have columns time, psi1, psi2'),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(content, message, tmp_path):
    (tmp_path / 'table.csv').write_bytes(content)
    with pytest.raises(ValueError, match=r'table\.csv') as error:
        table_samples(tmp_path / 'table.csv', RigParams())
    assert message in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('row', [1, 400, -1])
def test_a_wild_sample_is_no_turn(row, tmp_path):
    lines = TABLE.splitlines()
    lines[row] = f'{lines[row].split(",")[0]},500,-500'
    (tmp_path / 'table.csv').write_text('\n'.join(lines))
    assert len(table_samples(tmp_path / 'table.csv', RigParams()).seconds) == pytest.approx(800, abs=5)


def test_a_table_of_which_every_third_row_is_wild_is_read(tmp_path):
    lines = TABLE.splitlines()
    lines[3::3] = [f'{line.split(",")[0]},{place % 7},{-(place % 5)}' for place, line in enumerate(lines[3::3])]
    (tmp_path / 'table.csv').write_text('\n'.join(lines))
    assert table_samples(tmp_path / 'table.csv', RigParams()).plausible.mean() == pytest.approx(2 / 3, abs=0.1)
