"""A small share of `make fuzz`, and all inputs that it once found."""

import base64
import json

import fuzz
import pytest

FOUND = sorted(fuzz.CORPUS.glob("*.json"))


@pytest.fixture(scope="module")
def kinds():
    return fuzz.inputs()


def test_every_good_input_is_read(kinds, tmp_path):
    for kind in kinds.values():
        for content in kind.good:
            (tmp_path / kind.name).write_bytes(content)
            kind.read(tmp_path / kind.name)


@pytest.mark.parametrize("found", FOUND, ids=lambda path: path.stem)
def test_a_finding_stays_mended(kinds, tmp_path, found):
    values = json.loads(found.read_text())
    assert fuzz.fault_of(kinds[values["input"]], base64.b64decode(values["content"]), tmp_path) is None


def test_changed_inputs_are_read_or_refused_in_one_sentence(tmp_path):
    counts, findings = fuzz.fuzz(300, 7, tmp_path)
    assert len(counts) > 10
    assert not findings, findings[0]
