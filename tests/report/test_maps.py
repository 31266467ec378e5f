"""Maps of rewards, distances and episodes: what is drawn where, and what the captions say."""

from dataclasses import replace

import numpy as np
import pytest
from run_folders import POSES, ROOM, episode, state_map

from relm_irl_jax.report.episodes import episode_caption, episode_columns, episode_figure
from relm_irl_jax.report.maps import distance_caption, distance_figure, map_columns, reward_caption, reward_figure
from relm_irl_jax.saved_maps import SHORTEST_PATH


def panels_of(figure):
    """Titles and colours of the maps, without the colour bar."""
    return [(axes.get_title(), axes.collections[0]) for axes in figure.axes if axes.get_title()]


def test_maps_share_one_scale_and_one_colour_bar():
    saved = state_map(["rl", "relm-irl", "irl", SHORTEST_PATH])
    figure = distance_figure(saved)
    panels = panels_of(figure)
    assert [title for title, _ in panels] == ["Shortest path", "RL", "IRL", "RELM-IRL"]
    assert {collection.get_clim() for _, collection in panels} == {(0.0, max(v.max() for v in saved.values.values()))}
    assert len([axes for axes in figure.axes if axes.get_ylabel() == "distance in actions"]) == 1
    assert figure.get_suptitle() == "bathroom-0, target: lamp (state 20)"


def test_each_state_is_a_triangle_towards_its_heading():
    """State 1 is at (0, 0) and faces +x, so its triangle reaches from the place to x = 0.25; its value is its own."""
    saved = state_map(["rl"])
    collection = panels_of(distance_figure(saved))[0][1]
    corners = collection.get_paths()[1].vertices
    assert {tuple(corner) for corner in corners} == {(0.0, 0.0), (0.25, 0.25), (0.25, -0.25)}
    np.testing.assert_array_equal(collection.get_array(), saved.values["rl"])


def test_states_without_a_path_are_left_blank():
    values = {"rl": np.full(24, np.inf), SHORTEST_PATH: np.where(np.arange(24) < 4, -1.0, 7.0)}
    figure = distance_figure(replace(state_map(["rl"]), values=values))
    shortest, learned = (collection.get_array() for _, collection in panels_of(figure))
    assert np.ma.getmaskarray(np.ma.masked_invalid(learned)).all()
    assert np.ma.getmaskarray(np.ma.masked_invalid(shortest)).sum() == 4
    assert panels_of(figure)[0][1].get_clim() == (0.0, 7.0)


@pytest.mark.parametrize("limits", [(-1.0, 0.0), None])
def test_rewards_are_drawn_on_the_scale_to_which_they_are_clipped(limits):
    saved = state_map(["irl", "relm-irl"], start=0, limits=limits)
    least = min(values.min() for values in saved.values.values())
    figure = reward_figure(saved)
    assert {collection.get_clim() for _, collection in panels_of(figure)} == {limits or (least, 0.0)}
    for axes in figure.axes[:2]:
        star, ring = (line.get_xydata()[0].tolist() for line in axes.lines)
        assert star == ROOM.location[20].tolist()
        assert ring == ROOM.location[0].tolist()


def test_captions_name_scene_target_and_methods():
    caption = reward_caption(state_map(["elm-irl", "irl"], start=3), "new")
    for part in ("bathroom-0", "not trained", "lamp (state 20)", "IRL and ELM-IRL, seed 0", "state 3 (ring)"):
        assert part in caption
    caption = distance_caption(state_map([SHORTEST_PATH, "rl"]), "II")
    for part in ("bathroom-0", "Task II", "lamp (state 20)", "as learned by RL", "seed 0"):
        assert part in caption
    assert "state 20 (star" in reward_caption(replace(state_map(["irl"]), category=""), "trained")
    assert "by IRL, ELM-IRL and RELM-IRL" in reward_caption(state_map(["relm-irl", "elm-irl", "irl"]), "trained")
    caption = episode_caption([episode(), episode([0, 1])], "III")
    assert caption.startswith("The first episodes of RELM-IRL, seed 0, on Task III: bathroom-0, target lamp (state 20)")


def test_a_map_is_saved_with_what_it_shows():
    columns = map_columns(state_map(["relm-irl", SHORTEST_PATH]))
    assert list(columns) == ["x", "z", "rotation", "Shortest path", "RELM-IRL"]
    assert {len(column) for column in columns.values()} == {24}


def test_episodes_show_both_paths_and_the_outcome():
    figure = episode_figure([episode(), episode([0, 1]), episode([20]), episode()])
    titles = [axes.get_title() for axes in figure.axes]
    assert "bathroom-0: found in 3 steps\n(shortest 3)" in titles
    assert "bathroom-0: not found in 1 steps\n(shortest 3)" in titles
    shortest, taken = figure.axes[0].lines[:2]
    np.testing.assert_array_equal(taken.get_xydata(), POSES.location[[0, 8, 16, 20]])
    np.testing.assert_array_equal(shortest.get_xydata(), POSES.location[[0, 4, 12, 20]])
    table = episode_columns([episode()])
    assert table["kind"].count("place") == 6
    assert [s for k, s in zip(table["kind"], table["step"], strict=True) if k == "taken"] == [0, 1, 2, 3]
