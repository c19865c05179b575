"""Tables of encoders as people have them: read, or refused with the line."""

import pytest

from dcdrw.trials.rolling import table_samples
from dcdrw_msgs_py.rig import RigParams
from tests.tracker.walking import walk

TRUTH = walk(8.0, 100.0)
TABLE = 'time,psi1,psi2\n' + ''.join(
    f'{time},{front},{rear}\n' for time, front, rear in zip(TRUTH.time, TRUTH.front, TRUTH.rear, strict=True)
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
    ],
    ids=['plain', 'bom', 'crlf', 'trailing commas', 'blank lines', 'quotes'],
)
def test_a_table_is_read_as_spreadsheets_write_it(content, tmp_path):
    (tmp_path / 'table.csv').write_bytes(content)
    samples = table_samples(tmp_path / 'table.csv', RigParams())
    assert len(samples.seconds) == pytest.approx(800, abs=5)


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        (TABLE.encode('utf-16'), 'line 1: byte 0xff is not UTF-8 text'),
        (TABLE.replace(',', ';').encode(), 'must have columns time, psi1, psi2'),
        (TABLE.replace(',', '\t').encode(), 'must have columns time, psi1, psi2'),
        (b'time,psi1,psi1,psi2\n0,0,0,0\n', 'has the column psi1 2 times'),
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
