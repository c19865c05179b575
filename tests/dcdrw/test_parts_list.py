"""Parts lists as people have them."""

import math

import pytest

from dcdrw.parts_list import read_parts
from dcdrw_sim.study.parts import Part
from tests import ROOT


@pytest.fixture
def read(tmp_path):
    def written(text):
        path = tmp_path / 'parts.csv'
        path.write_text(text, encoding='utf-8')
        return read_parts(path)

    return written


SOFT, OIL = Part('spring', 10.0, 'soft'), Part('dashpot', 100.0, 'oil')


@pytest.mark.parametrize(
    'text',
    [
        'kind,value,name\nspring,10,soft\ndashpot,100,oil\n',
        'Kind;Value;Name\nSPRING;10;soft\nDamper;100;oil\n',
        'type\tname\trate\n Spring \tsoft\t10 N/m\n\ndamper\toil\t0.1 N·s/mm\n',
        'kind,value [N/mm],name\nspring,0.01,soft\ndashpot,100 Ns/m,oil\n',
        'kind;value;name\nspring;10,0;soft\ndashpot;0,1 N*s/mm;oil\n',
        'kind,value (kN/m),part number\nspring,"0,01",soft\ndamper,100 N/(m/s),oil\n',
        'Typ;Wert;Bezeichnung\nZugfeder;0,01 N/mm;soft\nÖldämpfer;100 Ns/m;oil\n',
        'sep=;\n\nOur parts;;\nkind;value;name\nspring;10;soft\n;;\ndamper;100;oil\n',
        'kind,value,unit,name\nspring,0.01,N/mm,soft\ndamper,100,kg/s,oil\n',
        'part,type,stiffness N/mm,damping in N·s/m\nsoft,Tension spring,0.01,\noil,shock absorber,,100\n',
        'kind|value|name\nspring|10 N m^-1|soft\ndamper|0.1 N sec/mm|oil\n',
        'kind,value,name\nspring,~10 ± 1 N/m,soft\ndamper,100 N·s/m (adjusted),oil\n',
        'kind,value,name\n# spring,7,sold out\nspring,10,soft\ndamper,100,oil\n',
        'kind,value,name\nspring,0.685217659 lbf/ft,soft\ndamper,10 daN·s/m,oil\n',
        'kind,value,name\nspring,1.01971621 gf/mm,soft\ndamper,0.571014716 lbf·s/in,oil\n',
    ],
)
def test_separators_units_case_and_decimal_commas_all_tell_the_same(read, text):
    offer = read(text)
    assert offer.skipped == ()
    for part, expected in zip(offer.parts, (SOFT, OIL), strict=True):
        assert part._replace(value=0.0) == expected._replace(value=0.0)
        assert part.value == pytest.approx(expected.value, rel=1e-8)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'cp1252'])
def test_what_spreadsheets_write_on_any_system_is_read(tmp_path, encoding):
    path = tmp_path / 'parts.csv'
    path.write_bytes('kind;value;name\r\nspring;10 N/m;weiß\r\ndamper;1 000 N·s/m;Öl\r\n'.encode(encoding))
    assert read_parts(path).parts == (Part('spring', 10.0, 'weiß'), Part('dashpot', 1000.0, 'Öl'))


def test_a_column_that_nobody_reads_is_told(read):
    assert read('kind,value,peak force\nspring,10,4\ndamper,9,5\n').skipped == ("column 'peak force': not known",)


def test_free_lengths_are_read(read):
    spring, other, _ = read('kind,value,free length [mm]\nspring,10,300\nspring,12,\ndamper,9,\n').parts
    assert spring.free_length == pytest.approx(0.3)
    assert math.isnan(other.free_length)


def test_rated_limits_are_read_in_their_units(read):
    offer = read('kind,value,name,max_force [N],Max Stroke (mm),max_speed\nspring,10,,5,200,\ndamper,9,x,,0.3 m,0.5\n')
    spring, dashpot = offer.parts
    assert spring[3:6] == (5.0, pytest.approx(0.2), math.inf)
    assert dashpot[3:6] == (math.inf, pytest.approx(0.3), 0.5)


@pytest.mark.parametrize(
    ('row', 'reason'),
    [
        ('rope,5,x', "line 4: kind must be spring, dashpot or damper, got 'rope'"),
        ('spring,stiff,x', "line 4: value must be a number > 0, got 'stiff'"),
        ('spring,-1,x', "line 4: value must be a number > 0, got '-1'"),
        ('spring', "line 4: value must be a number > 0, got ''"),
        ('spring,"1,250",x', 'line 4: 1,250 may be 1.250 or 1250: write one of them'),
        ('spring,5 kg,x', "line 4: 'kg' is not a unit like N/m"),
        ('spring,5 N·s/m,x', "line 4: 'N·s/m' is not a unit like N/m"),
        ('spring,10-12,x', "line 4: value '10-12' is a range: write what it is set to"),
        ('spring,10,soft', 'line 4: the same part as in line 2'),
        ('gas spring,10,x', 'line 4: a gas spring has no stiffness in N/m'),
        ('spring,5,25,x', "line 4: more cells than the heading has: is ',' within a number or a name?"),
        ('spring damper,5,x', "line 4: kind must be spring, dashpot or damper, got 'spring damper'"),
        ('Total,110,', "line 4: kind must be spring, dashpot or damper, got 'Total'"),
    ],
)
def test_what_is_skipped_is_told(read, row, reason):
    offer = read(f'kind,value,name\nspring,10,soft\ndashpot,100,oil\n{row}\n')
    assert offer.parts == (SOFT, OIL)
    assert offer.skipped == (reason,)


def test_a_thousand_is_told_from_a_decimal_where_the_list_shows_its_sign(read):
    spring, *_ = read('kind;value\nspring;1,250\ndamper;5,5\n').parts
    assert spring.value == pytest.approx(1.25)
    spring, *_ = read('kind,value\nspring,"1,250.5"\ndamper,5\n').parts
    assert spring.value == pytest.approx(1250.5)
    assert read('kind;value\nspring;1.250\nspring;5,5\ndamper;2\n').skipped == (
        'line 2: 1.250 may be 1,250 or 1250: write one of them',
    )


def test_a_length_without_unit_that_no_part_has_is_told(read):
    offer = read('kind,value,stroke\nspring,10,0.45\nspring,12,450\ndamper,9,\n')
    assert offer.skipped == ('line 3: max_stroke would be 450 m: write its unit',)


def test_a_name_commands_no_terminal(read):
    assert read('kind,value,name\nspring,10,\x1b[31msoft\ndamper,9,\n').parts[0].name == '\\x1b[31msoft'


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', 'must begin with the heading kind,value,name'),
        ('a,b\n1,2\n', "heading kind,value,name, got 'a,b'"),
        ('kind,value\nspring,5\n', 'has no dashpot that can be used'),
        ('kind,value\nrope,5\n', "has no spring that can be used; line 2: kind must be spring.*got 'rope'"),
        ('kind,value,value\nspring,5,6\ndamper,7,8\n', 'has 2 columns of value: leave one'),
        ('kind,value,name\n,N/mm,-\nspring,5,\n', r'line 2: units belong into the heading, as value \[N/m\]'),
        ('kind,value,name\nspring,5,"x\ndamper,5,\n', 'line 2: a quotation mark is not closed'),
        ('PK\x03\x04\x14', 'is a workbook: save its sheet as CSV'),
    ],
)
def test_what_is_no_list_is_told(read, text, message):
    with pytest.raises(ValueError, match=message):
        read(text)


def test_the_sample_list_is_read_whole():
    offer = read_parts(ROOT / 'config' / 'parts.csv')
    assert (offer.pairs, offer.skipped) == (16, ())
    assert {part.value for part in offer.parts} == {5.25, 16.0, 40.0, 100.0, 8.0, 20.0, 50.0}
