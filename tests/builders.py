"""Small scenes that tests compute by hand."""

from dataclasses import replace

import numpy as np

from relm_irl_jax.scenes.scene import Scene, pose_graph, shortest_path_distances


def grid_scene(columns: int, rows: int, *, name: str = "bathroom-0", features: np.ndarray | None = None) -> Scene:
    """An empty room of columns × rows places; features are one-hot unless given."""
    location, rotation, graph = pose_graph([(x, z) for x in range(columns) for z in range(rows)])
    n_states = len(graph)
    return Scene(
        name=name,
        room_type=name.rsplit("-", 1)[0],
        location=location,
        rotation=rotation,
        graph=graph,
        shortest_path_distance=shortest_path_distances(graph),
        features=np.eye(n_states, dtype=np.float32) if features is None else features,
    )


def labelled(scene: Scene, categories: int, generator: np.random.Generator) -> Scene:
    """The scene with made-up labels: every category is seen best from a state of its own."""
    visible = generator.uniform(0.0, 0.005, (scene.n_states, categories)).astype(np.float32)
    best = generator.choice(scene.n_states, categories, replace=False)
    visible[best, np.arange(categories)] = 0.4
    return replace(scene, visible_object=visible, categories=tuple(f"thing-{i}" for i in range(categories)))
