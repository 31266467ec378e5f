"""An agent of the package searches in a scene of no run."""

import io
from dataclasses import replace

import numpy as np
import pytest
from builders import grid_scene
from PIL import Image
from rich.console import Console

from relm_irl_jax.agents.map.agent import MapAgent
from relm_irl_jax.agents.map.loss import initial_parameters
from relm_irl_jax.agents.map.network import VIEW, MapNetwork
from relm_irl_jax.play import search
from relm_irl_jax.scenes.rooms.room_specifications import SOURCE

NETWORK = MapNetwork(width=16, channels=8)


@pytest.fixture
def scene(monkeypatch):
    """A room of noise, and the agent with a small, untrained network."""
    room = grid_scene(3, 2)
    views = np.random.default_rng(0).integers(0, 255, (room.n_states, VIEW, VIEW, 3)).astype(np.uint8)
    monkeypatch.setattr(
        search,
        "packaged_agent",
        lambda views: (MapAgent(lambda _: views(VIEW), network=NETWORK), initial_parameters(NETWORK)),
    )
    return replace(room, observation=views)


@pytest.mark.slow
def test_a_search_has_a_belief_and_a_frame_for_every_step(scene, tmp_path):
    found, path = search.search_scene(scene, [13], 0, 0)
    assert found.steps.tolist() == list(range(len(path.states) - 1))
    np.testing.assert_allclose(found.probability.sum((1, 2, 3)), 1, rtol=1e-3)
    few = replace(
        found,
        path=found.path[:3],
        steps=found.steps[:2],
        **{name: getattr(found, name)[:2] for name in ("probability", "free", "coverage", "views")},
    )
    frames = search.search_frames(few)
    search.write_search_gif(tmp_path / "search.gif", frames)
    with Image.open(tmp_path / "search.gif") as animation:
        assert animation.n_frames == len(frames) == 3
    shown = io.StringIO()
    search.show_in_terminal(frames[:1], Console(file=shown, force_terminal=True, width=40), 0.0)
    assert "▀" in shown.getvalue()


def test_the_agent_sees_built_in_rooms_at_its_own_size(scene, monkeypatch):
    monkeypatch.setattr(
        search, "scene_views", lambda _, settings, size, name: np.full((1, size, size, 3), int(name[-2:]), np.uint8)
    )
    assert (search._views(replace(scene, source=SOURCE, name="bathroom-50"), 64) == 50).all()
    np.testing.assert_array_equal(search._views(scene, VIEW), scene.observation)
