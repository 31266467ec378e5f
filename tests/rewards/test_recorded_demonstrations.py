"""Recorded demonstrations in the place of the expert's: used for training targets, and for nothing else."""

import json

import numpy as np
import pytest
from builders import grid_scene

from relm_irl_jax.config import Config
from relm_irl_jax.demonstrations import load_demonstrations_by_scene, save_demonstrations
from relm_irl_jax.errors import InputError
from relm_irl_jax.experts import shortest_path_expert, shortest_path_trajectories
from relm_irl_jax.irl import MaxMarginSettings
from relm_irl_jax.rewards.demonstrated import demonstrate_targets, describe_recorded, learn_demonstrated_rewards
from relm_irl_jax.rewards.settings import IrlSettings
from relm_irl_jax.stages.rewards import announce_recorded
from relm_irl_jax.task_settings import TaskSettings
from relm_irl_jax.tasks import draw_split

ROOMS = [grid_scene(3, 2, name="bathroom-0"), grid_scene(3, 3, name="bedroom-0")]
SPLIT = draw_split(ROOMS, [], TaskSettings(training_targets=4, new_targets_per_scene=2), 0)

LENIENT = MaxMarginSettings(regularisation=10.0, compare_with_lp=False, penalty=2.0)
"""Experts need not be optimal."""


def detour(scene, target):
    """A demonstration that first turns round once."""
    start = int(np.argmax(scene.shortest_path_distance[:, target]))
    path = shortest_path_trajectories(scene, target, [start])[0]
    turns = [start]
    for _ in range(4):
        turns.append(int(scene.graph[turns[-1], 1]))
    return {"states": turns + path.states[1:].tolist(), "actions": [1] * 4 + path.actions.tolist()}


def write(path, lines):
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def test_recorded_demonstrations_replace_the_experts_for_their_targets(tmp_path):
    first, evaluated = SPLIT.training[0], SPLIT.new[0]
    lines = [
        {"scene": ROOMS[t.scene].name} | detour(ROOMS[t.scene], t.state)
        for t in (first, evaluated)  # the second leads to an evaluation target
    ]
    settings = IrlSettings(max_margin=LENIENT, trajectories=3, demonstrations=write(tmp_path / "walks.jsonl", lines))
    recorded, shown = (
        demonstrate_targets(ROOMS, SPLIT, each, 0)
        for each in (settings, IrlSettings(max_margin=LENIENT, trajectories=3))
    )
    assert [t.states.tolist() for t in recorded[0]] == [lines[0]["states"]]
    for ours, theirs in zip(recorded[1:], shown[1:], strict=True):
        assert [t.states.tolist() for t in ours] == [t.states.tolist() for t in theirs]
    phi = [np.eye(room.n_states, 36) for room in ROOMS]
    rewards = learn_demonstrated_rewards(ROOMS, SPLIT, phi, settings, 0)
    assert not {r.target.state for r in rewards if r.target.scene == evaluated.scene} & SPLIT.evaluation_only(0)
    own = next(r for r in rewards if r.target == first)
    assert own.trained
    assert set(own.starts) == set(lines[0]["states"][:-1])


def test_a_line_says_what_is_used(tmp_path, capsys):
    lines = [
        {"scene": ROOMS[t.scene].name} | detour(ROOMS[t.scene], t.state)
        for t in (SPLIT.training[0], SPLIT.training[0], SPLIT.training[2], SPLIT.new[0])
    ]
    file = write(tmp_path / "walks.jsonl", lines)
    assert describe_recorded(ROOMS, SPLIT, file) == (
        f"{file}: 3 of 4 demonstrations lead to 2 of 4 training targets and are used; the shortest-path expert "
        "demonstrates the other 2 targets."
    )
    announce_recorded(Config(irl=IrlSettings(demonstrations=file)), ROOMS, SPLIT, 3)
    announce_recorded(Config(), ROOMS, SPLIT, 3)
    assert " ".join(capsys.readouterr().err.split()) == f"Seed 3: {describe_recorded(ROOMS, SPLIT, file)}"


def test_the_expert_follows_the_record(tmp_path):
    target = SPLIT.training[0]
    scene = ROOMS[target.scene]
    # Turning left three times instead of right once is worse, and is what the demonstration does.
    expert = shortest_path_expert(scene, target.state)
    start = next(s for s in range(scene.n_states) if expert.action[s] == 1 and scene.graph[s, 1] == target.state)
    states = [start]
    for _ in range(3):
        states.append(int(scene.graph[states[-1], 2]))
    line = {"scene": scene.name, "states": states, "actions": ["RotateLeft"] * 3}
    settings = IrlSettings(max_margin=LENIENT, trajectories=3, demonstrations=write(tmp_path / "left.jsonl", [line]))
    phi = [np.eye(room.n_states, 36) for room in ROOMS]
    recorded, shown = (
        next(r for r in learn_demonstrated_rewards(ROOMS, SPLIT, phi, each, 0) if r.target == target)
        for each in (settings, IrlSettings(max_margin=LENIENT, trajectories=3))
    )
    assert not np.allclose(recorded.weights, shown.weights)


def test_a_file_written_is_read_again(tmp_path):
    walks = {room.name: shortest_path_trajectories(room, 5, [0, 9]) for room in ROOMS}
    save_demonstrations(walks, tmp_path / "walks.jsonl")
    read = load_demonstrations_by_scene(tmp_path / "walks.jsonl", ROOMS)
    for room, ours in zip(ROOMS, read, strict=True):
        assert [t.states.tolist() for t in ours] == [t.states.tolist() for t in walks[room.name]]
        assert [t.actions.tolist() for t in ours] == [t.actions.tolist() for t in walks[room.name]]


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ([{"scene": "attic-0", "states": [0, 1], "actions": [1]}], "attic-0"),
        ([{"states": [0, 1], "actions": [1]}], "`scene` is None; give one of bathroom-0, bedroom-0"),
        ([{"scene": "bathroom-0", "states": [0, 0, 1], "actions": [0, 1]}], "no demonstration leads to|state 0 to 0"),
        ([], "no demonstration leads to a training target, such as state"),
    ],
)
def test_files_that_cannot_be_used_are_one_sentence(tmp_path, lines, sentence):
    settings = IrlSettings(demonstrations=write(tmp_path / "bad.jsonl", lines))
    with pytest.raises(InputError, match=sentence):
        demonstrate_targets(ROOMS, SPLIT, settings, 0)
