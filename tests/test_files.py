"""Files of tables and arrays."""

import numpy as np
import pytest

from relm_irl_jax.errors import InputError
from relm_irl_jax.files import load_arrays, load_arrays_and_metadata, read_numbers, read_table, save_arrays, write_table


def test_tables_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "new" / "table.csv"
    write_table(path, {"name": ["a,b", 'say "c"'], "value": np.asarray([0.1, np.nan])})
    assert read_table(path) == {"name": ["a,b", 'say "c"'], "value": ["0.1", "nan"]}
    np.testing.assert_array_equal(read_numbers(path, ["value"])["value"], [0.1, np.nan])
    with pytest.raises(ValueError, match="shorter"):
        write_table(path, {"a": [1, 2], "b": [1]})
    assert [file.name for file in path.parent.iterdir()] == ["table.csv"]


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"a,b\n1,2\n3\n", "line 3 has 1 fields, not 2"),
        (b"a,b\n1,x\n", "column `b`"),
        (b"a\n1\n", "column `b` is missing"),
        (b"", "column `a` is missing"),
        (b"\xff\xfe\n", "cannot be read as CSV"),
    ],
)
def test_damaged_tables_are_one_sentence(tmp_path, content, fault):
    (tmp_path / "t.csv").write_bytes(content)
    with pytest.raises(InputError, match=rf"t\.csv: {fault}"):
        read_numbers(tmp_path / "t.csv", ["a", "b"])


def test_arrays_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "a.safetensors"
    save_arrays(path, {"x": np.arange(6.0).reshape(2, 3).T}, {"note": "by hand"})
    arrays, metadata = load_arrays_and_metadata(path)
    np.testing.assert_array_equal(arrays["x"], np.arange(6.0).reshape(2, 3).T)
    assert metadata == {"note": "by hand"}
    path.write_bytes(b"no arrays")
    with pytest.raises(InputError, match=r"a\.safetensors: cannot be read"):
        load_arrays(path)
    with pytest.raises(InputError, match=r"b\.safetensors is missing"):
        load_arrays(tmp_path / "b.safetensors")
