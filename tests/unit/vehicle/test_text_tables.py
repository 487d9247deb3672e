"""Tables of text say where a cell that cannot be read stands."""

import math

import numpy as np
import pytest

from trigpoint.errors import InputError
from trigpoint_vehicle.core.text_tables import WHITESPACE, SourceText, text_table


def test_comments_empty_lines_and_a_byte_order_mark_are_no_rows() -> None:
    table = text_table(SourceText("a.csv", "\ufeff# made by hand\nt, x\n\n1, 2\n# end\n3, 4\n"))
    assert table.columns == ("t", "x")
    assert table.numbers("x").tolist() == [2.0, 4.0]


@pytest.mark.parametrize("cell", ["", "nan", "NaN", "NA", "null"])
def test_a_cell_without_a_measurement_is_nan(cell: str) -> None:
    table = text_table(SourceText("a.csv", f"t,x\n1,{cell}\n2,5\n"))
    assert math.isnan(table.numbers("x")[0])
    assert table.numbers("x")[1] == 5.0


def test_a_cell_that_is_no_number_is_refused_with_file_row_and_value() -> None:
    table = text_table(SourceText("a.csv", "# one\nt,x\n1,2\n2,fast\n"))
    with pytest.raises(InputError, match=r"a.csv, row 4: x is 'fast', not a number"):
        table.numbers("x")


def test_an_infinite_cell_is_refused() -> None:
    table = text_table(SourceText("a.csv", "t,x\n1,2\n2,inf\n"))
    with pytest.raises(InputError, match=r"a.csv, row 3: x is 'inf', not a finite number"):
        table.numbers("x")


def test_an_unknown_column_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match="a.csv: no column 'y'; there are t, x"):
        text_table(SourceText("a.csv", "t,x\n1,2\n")).numbers("y")


def test_a_column_named_twice_is_refused() -> None:
    with pytest.raises(InputError, match="a column name stands twice in t, x, x"):
        text_table(SourceText("a.csv", "t,x,x\n1,2,3\n"))


def test_an_empty_file_has_no_header() -> None:
    with pytest.raises(InputError, match="a.csv: no header row"):
        text_table(SourceText("a.csv", "\n"))


def test_a_header_alone_is_a_table_without_rows() -> None:
    table = text_table(SourceText("a.csv", "t,x\n"))
    assert table.numbers("x").shape == (0,)
    assert table.stamps_ns("t", unit_ns=1, epoch_ns=0).shape == (0,)


@pytest.mark.parametrize(
    ("text", "unit_ns", "stamp_ns"),
    [
        ("1352040857.100001", 1_000_000_000, 1_352_040_857_100_001_000),
        ("1352040857100001", 1_000, 1_352_040_857_100_001_000),
        ("1352040857100001007", 1, 1_352_040_857_100_001_007),
        ("1.352040857e9", 1_000_000_000, 1_352_040_857_000_000_000),
        ("-0.25", 1_000_000_000, -250_000_000),
    ],
)
def test_stamps_keep_every_digit(text: str, unit_ns: int, stamp_ns: int) -> None:
    table = text_table(SourceText("a.csv", f"t\n{text}\n"))
    assert table.stamps_ns("t", unit_ns=unit_ns, epoch_ns=0).tolist() == [stamp_ns]


@pytest.mark.parametrize("text", ["nan", "soon", "1e30", "1709510400000"])
def test_a_cell_that_is_no_time_is_refused(text: str) -> None:
    table = text_table(SourceText("a.csv", f"t\n1\n{text}\n"))
    with pytest.raises(InputError, match=f"a.csv, row 3: t is '{text}'"):
        table.stamps_ns("t", unit_ns=1_000_000_000, epoch_ns=0)


def test_a_cell_in_quotes_may_go_over_several_lines() -> None:
    table = text_table(SourceText("a.csv", 't,name\n1,"big\npole"\n2,corner\n'))
    assert (table.numbers("t").tolist(), table.line_number) == ([1.0, 2.0], (3, 4))


def test_a_cell_too_long_to_be_one_is_refused() -> None:
    with pytest.raises(InputError, match=r"a.csv: cannot be read as a table: field larger than field limit"):
        text_table(SourceText("a.csv", "t,name\n1," + 200_000 * "x"))


def test_columns_may_be_split_by_white_space_and_named_from_outside() -> None:
    table = text_table(SourceText("a.dat", "  1.0 \t 2.0\n3.0 4.0\n"), columns=("t", "x"), delimiter=WHITESPACE)
    assert np.array_equal(table.numbers("x"), [2.0, 4.0])
