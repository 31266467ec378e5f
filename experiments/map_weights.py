"""Train the mapping agent's weights that come with the package: `make weights`.

Rooms are the generated ones from number 1000 on, apart from all that any task evaluates on. An interrupted training
begins again.
"""

import argparse
import hashlib
import shlex
import sys
import time
from pathlib import Path

import jax

from relm_irl_jax.agents.map.agent import train_on_rooms
from relm_irl_jax.agents.map.network import MapNetwork
from relm_irl_jax.agents.map.training_rooms import GeneratedRooms
from relm_irl_jax.agents.map.weights import SHIPPED, save_weights
from relm_irl_jax.agents.settings import FRAMES, MapSettings
from relm_irl_jax.exits import errors_as_sentences
from relm_irl_jax.files import ensure_writable
from relm_irl_jax.progress import progress_bar
from relm_irl_jax.scenes.rooms.room_specifications import VERSION
from relm_irl_jax.scenes.rooms.training_rooms import FIRST_ROOM
from relm_irl_jax.types import Row, State, TrainingLog


class ProgressLog(TrainingLog):
    """Moves a progress bar, and prints a row now and then."""

    def __init__(self, advance):
        self._advance, self._frames = advance, 0.0

    def add(self, state: State, rows: list[Row]) -> None:
        """Report a finished chunk of updates."""
        self._advance(int(rows[-1]["frames"] - self._frames))
        self._frames = rows[-1]["frames"]
        if len(rows) % 10 == 0:
            means = {name: sum(row[name] for row in rows[-10:]) / 10 for name in rows[-1] if name != "frames"}
            print(f"{rows[-1]['frames']:9.0f}", *(f"{name} {value:.3f}" for name, value in means.items()), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=MapSettings().rooms, help="training rooms, a third of each type")
    parser.add_argument("--frames", type=int, default=FRAMES["map"], help="views of all walks")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=SHIPPED)
    arguments = parser.parse_args()
    given = sys.argv[1:]
    ensure_writable(arguments.output.parent)

    begin, used = time.perf_counter(), time.process_time()
    settings, rooms = MapSettings(rooms=arguments.rooms), GeneratedRooms(arguments.rooms)
    with progress_bar("training the mapping agent", arguments.frames, "frames") as advance:
        parameters, curve = train_on_rooms(
            jax.random.key(arguments.seed), rooms, arguments.frames, settings, ProgressLog(advance), MapNetwork()
        )
    provenance = {
        "command": f"make weights ARGS='{shlex.join(given)}'" if given else "make weights",
        "rooms": f"{arguments.rooms // 3} of each type from number {FIRST_ROOM}, generator version {VERSION}",
        "settings": str(settings),
        "frames": str(int(curve.frames[-1])),
        "seed": str(arguments.seed),
        "location_loss": f"{curve.location_loss[-20:].mean():.3f} nats in the last 20 chunks",
        "duration": f"{time.perf_counter() - begin:.0f} s, {time.process_time() - used:.0f} CPU seconds",
    }
    save_weights(arguments.output, parameters, provenance)
    print(arguments.output, hashlib.sha256(arguments.output.read_bytes()).hexdigest())


if __name__ == "__main__":
    with errors_as_sentences("weights"):
        main()
