"""The metric agent through the whole pipeline; apart from the siamese agent's tests, so that both run in parallel."""

import json

import pytest
from command import EXPERIMENT, QUICK, relm_irl

from relm_irl_jax.files import read_table

SMALL = ("--agent", "metric", "--metric.width", "16", "--metric.dimension", "8", "--metric.workers", "24")


@pytest.mark.slow
def test_the_metric_agent_runs_through_the_same_chain(tmp_path):
    options = (*QUICK, *SMALL, "--frames", "9216", "--methods", "irl", "relm-irl")
    code, _, err = relm_irl(tmp_path, "train", "--config", str(EXPERIMENT), "--run", "metric", *options)
    assert code == 0, err
    run = tmp_path / "metric"
    rows = json.loads((run / "results.json").read_text())["rows"]
    assert {(row["method"], row["agent"]) for row in rows} == {("irl", "metric"), ("relm-irl", "metric")}
    assert float(read_table(run / "curves" / "irl-seed-0.csv")["states_visited"][-1]) > 0.9
    for room_type in ("bathroom", "bedroom", "living_room"):
        assert (run / "figures" / f"distance-II-{room_type}.png").stat().st_size > 0
        assert "RELM-IRL" in read_table(run / "figures" / f"distance-II-{room_type}.csv")
    assert "metric agent" in (run / "report.md").read_text()
    code, _, err = relm_irl(tmp_path, "play", "metric", "--method", "irl")
    assert code == 0, err
