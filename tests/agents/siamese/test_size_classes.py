"""Scenes of similar size, of which an update draws one each: how they are divided, padded and drawn."""

import dataclasses
from itertools import pairwise

import hypothesis.strategies as st
import jax
import jax.numpy as jnp
import numpy as np
from builders import grid_scene
from hypothesis import given
from tiny import SMALL, problem

from relm_irl_jax.agents.padding import divide_by_size
from relm_irl_jax.agents.siamese.imagined_targets import draw_targets, evaluate_drawn
from relm_irl_jax.agents.siamese.imagined_training import prepare_imagined
from relm_irl_jax.agents.siamese.imagined_update import walk
from relm_irl_jax.rewards.imagined import constant_rewards
from relm_irl_jax.tasks import Target, TaskSplit
from relm_irl_jax.world import build_targets, build_world

SHAPES = {"bathroom-0": (3, 2), "bedroom-0": (2, 2), "bedroom-1": (3, 3), "bedroom-2": (4, 2)}
VIEWS = np.random.default_rng(0).normal(size=(36, 12)).astype(np.float32)
SCENES = [
    grid_scene(*shape, name=name, features=VIEWS[: 4 * shape[0] * shape[1]] + number)
    for number, (name, shape) in enumerate(SHAPES.items())
]
SIZES = np.array([scene.n_states for scene in SCENES])
TARGETS = tuple(Target(number, 5 + number) for number in range(4))
SETTINGS = dataclasses.replace(
    SMALL, imagine="told", heads="shared", scenes_at_once=2, targets_at_once=3, workers=30, t_max=40
)


def prepared():
    """Four small rooms in two classes; every state is a target."""
    split = TaskSplit(TARGETS, (), (), ())
    states = [np.roll(np.arange(size), -target.state) for size, target in zip(SIZES, TARGETS, strict=True)]
    imagined = constant_rewards(SCENES, split, states, step=-1.0, target=7.0, collision=np.inf, told=False)
    world = build_world(SCENES)
    one = dataclasses.replace(problem(cap=60), world=world, targets=build_targets(SCENES, list(TARGETS)))
    return prepare_imagined(jax.random.key(0), dataclasses.replace(one, imagined=imagined), SETTINGS)


@given(st.lists(st.tuples(st.integers(1, 50), st.integers(0, 2)), min_size=1, max_size=20), st.integers(1, 25))
def test_every_scene_is_in_one_class_of_its_head_and_size(scenes, at_once):
    sizes, heads = (np.array(column) for column in zip(*scenes, strict=True))
    classes = divide_by_size(sizes, heads, at_once)
    np.testing.assert_array_equal(np.sort(np.concatenate(classes)), np.arange(len(scenes)))
    assert len(classes) <= max(len(scenes), at_once)
    for one in classes:
        assert len(one) > 0
        assert len(set(heads[one].tolist())) == 1
    for head in set(heads.tolist()):
        of_head = sorted((sizes[one].min(), sizes[one].max()) for one in classes if heads[one[0]] == head)
        assert all(first[1] <= second[0] for first, second in pairwise(of_head))


def test_few_scenes_are_all_drawn_in_their_order():
    assert [one.tolist() for one in divide_by_size(SIZES, np.array([1, 0, 0, 0]), 4)] == [[0], [1], [2], [3]]


def test_scenes_of_a_class_are_drawn_equally_often_and_their_padding_is_not_visited():
    """Walks by chance in four rooms: each step is one of the drawn room, with the reward of its target."""
    _, inputs, _ = prepared()
    pairs, sizes = inputs.pairs, SIZES.tolist()
    assert [one.size.tolist() for one in pairs.classes] == [[24, 16], [36, 32]]
    firsts = np.cumsum([0, *sizes])[:-1]

    @jax.jit
    def update(key):
        drawn = draw_targets(key, pairs, jnp.float32(0.5))
        logits = jnp.zeros((pairs.first_pair[-1], 4))
        return drawn, walk(key, logits, inputs, drawn, 40)

    rooms = []
    for seed in range(40):
        drawn, steps = update(jax.random.key(seed))
        first = np.asarray(drawn.in_world)[[0, 24]]
        of_update = np.searchsorted(firsts, first)
        np.testing.assert_array_equal(firsts[of_update], first)
        rooms.append(of_update)
        state, slot = np.divmod(np.asarray(steps.pair), 3)
        next_state, next_slot = np.divmod(np.asarray(steps.next_pair), 3)
        number = np.asarray(pairs.worker_class)
        offset = np.array([0, 24])[number]
        local, target = state - offset, np.asarray(drawn.target)[number, slot]
        assert (local < SIZES[of_update][number]).all()
        np.testing.assert_array_equal(slot, next_slot)
        in_world = np.asarray(drawn.in_world)
        moved = np.asarray(inputs.world.successor)[in_world[state], np.asarray(steps.action)]
        np.testing.assert_array_equal(in_world[next_state], moved)
        np.testing.assert_array_equal(steps.reward, np.where(next_state - offset == target, 7.0, -1.0))
    for column, members in zip(np.transpose(rooms), ((0, 1), (2, 3)), strict=True):
        assert set(column.tolist()) == set(members)
        assert 8 <= (column == members[0]).sum() <= 32


def test_a_drawn_room_is_evaluated_as_if_it_were_alone():
    state, inputs, form = prepared()
    pairs, network = inputs.pairs, form.network
    drawn = jax.jit(draw_targets)(jax.random.key(3), pairs, jnp.float32(0.0))
    evaluated = jax.jit(evaluate_drawn, static_argnums=0)(network, state.parameters, inputs.world, pairs, drawn)
    features = np.asarray(inputs.world.features)
    for number, begin in enumerate((0, 24)):
        first = int(drawn.in_world[begin])
        views = jnp.asarray(first + np.arange(5), jnp.int32)[None, :, None]
        for slot, target in enumerate(np.asarray(drawn.target)[number].tolist()):
            rows = jnp.zeros((1, 5), jnp.int32)
            alone = jax.jit(network.apply)(
                state.parameters, features, jnp.asarray([first + target]), views, rows, jnp.zeros(1, jnp.int32)
            )
            chosen = (begin + np.arange(5)) * 3 + slot
            np.testing.assert_allclose(evaluated.logits[chosen], alone.logits[0], atol=1e-6)
            np.testing.assert_allclose(evaluated.value[chosen], alone.value[0], atol=1e-6)
