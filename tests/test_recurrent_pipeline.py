"""The recurrent agent through the whole pipeline; apart from other agents' tests, so that they run in parallel."""

import json

import pytest
from command import EXPERIMENT, QUICK, relm_irl

from relm_irl_jax.files import read_table

SMALL = ("--agent", "recurrent", "--recurrent.workers", "24", "--recurrent.t-max", "8", "--recurrent.width", "16")


@pytest.mark.slow
def test_the_recurrent_agent_runs_through_the_same_chain(tmp_path):
    options = (*QUICK, *SMALL, "--recurrent.memory", "16", "--recurrent.cell", "lstm", "--methods", "rl", "relm-irl")
    code, _, err = relm_irl(tmp_path, "train", "--config", str(EXPERIMENT), "--run", "run", "--task", "III", *options)
    assert code == 0, err
    run = tmp_path / "run"
    rows = json.loads((run / "results.json").read_text())["rows"]
    assert {(row["method"], row["agent"]) for row in rows} == {("rl", "recurrent"), ("relm-irl", "recurrent")}
    assert float(read_table(run / "curves" / "relm-irl-seed-0.csv")["frames"][-1]) >= 1536
    assert "recurrent agent" in (run / "report.md").read_text()
    code, _, err = relm_irl(tmp_path, "play", "run", "--method", "relm-irl")
    assert code == 0, err
    code, _, err = relm_irl(tmp_path, "train", *options, "--task", "III", "--recurrent.heads", "scene")
    assert code == 2
    assert "recurrent.heads: scene has no head for the unseen scenes of task III" in err
