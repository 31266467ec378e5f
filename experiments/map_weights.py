"""Train the mapping agent's weights that come with the package: `python experiments/map_weights.py`.

Rooms are the built-in ones from number 1000 on, apart from all that any task evaluates on. Living rooms, the hardest,
are walked twice as often as the others.
"""

import argparse
import hashlib
import shlex
import sys
import time
from pathlib import Path

import numpy as np

from relm_irl_jax.agents.map.network import VIEW, MapNetwork
from relm_irl_jax.agents.map.train import Losses, MapSettings, TrainState, train_map
from relm_irl_jax.agents.map.training_data import FIRST_ROOM, Room, to_room, training_numbers
from relm_irl_jax.agents.map.weights import SHIPPED, save_weights
from relm_irl_jax.scenes.rooms.generate import generate_room
from relm_irl_jax.scenes.rooms.room_specifications import VERSION


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=600, help="training rooms, a third of each type")
    parser.add_argument("--steps", type=int, default=MapSettings().steps)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=SHIPPED)
    arguments = parser.parse_args()

    begin = time.perf_counter()
    rooms: list[Room] = []
    for room_type, number in training_numbers(arguments.rooms):
        room = to_room(generate_room(room_type, number, image_size=VIEW))
        rooms += [room] * (2 if room_type == "living_room" else 1)
    rendered = time.perf_counter() - begin

    def report(update: int, losses: Losses, _: TrainState) -> None:
        numbers = " ".join(f"{value:.2f}" for value in losses.pose)
        top = " ".join(f"{value:.2f}" for value in losses.top)
        print(f"{update:6d} {time.perf_counter() - begin:7.0f} s  nats {numbers}  top {top}", flush=True)

    settings = MapSettings(steps=arguments.steps)
    parameters, curve = train_map(rooms, settings, arguments.seed, MapNetwork(), report)
    save_weights(
        arguments.output,
        parameters,
        {
            "command": shlex.join(["python", *sys.argv]),
            "rooms": f"{arguments.rooms // 3} of each type from number {FIRST_ROOM}, generator version {VERSION}",
            "settings": str(settings),
            "seed": str(arguments.seed),
            "nats": np.array2string(curve.pose[-1], precision=3),
            "seconds": f"{time.perf_counter() - begin:.0f}, of which rendering {rendered:.0f}",
        },
    )
    print(arguments.output, hashlib.sha256(arguments.output.read_bytes()).hexdigest())


if __name__ == "__main__":
    main()
