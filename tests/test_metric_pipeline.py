"""The metric agent through the whole pipeline; apart from the other such tests, so that both run side by side."""

import json

from command import EXPERIMENT, QUICK, in_process

from relm_irl_jax.files import read_table


def test_the_metric_agent_runs_through_the_same_chain(tmp_path, monkeypatch):
    small = ("--agent", "metric", "--metric.width", "32", "--metric.dimension", "16", "--metric.workers", "96")
    methods = ("--methods", "irl", "relm-irl")
    in_process(monkeypatch, tmp_path, "train", "--config", str(EXPERIMENT), "--run", "metric", *QUICK, *small, *methods)
    rows = json.loads((tmp_path / "metric" / "results.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"irl", "relm-irl"}
    assert float(read_table(tmp_path / "metric" / "curves" / "irl-seed-0.csv")["states_met"][-1]) > 0.9
    for room_type in ("bathroom", "bedroom", "living_room"):
        assert (tmp_path / "metric" / "figures" / f"distance-II-{room_type}.png").stat().st_size > 0
        assert "RELM-IRL" in read_table(tmp_path / "metric" / "figures" / f"distance-II-{room_type}.csv")
    assert "metric agent (hindsight: strict)" in (tmp_path / "metric" / "report.md").read_text()
    in_process(monkeypatch, tmp_path, "play", "metric", "--method", "irl")
