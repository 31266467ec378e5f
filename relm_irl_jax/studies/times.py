"""How long the pieces of a study took, over all calls of its command."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relm_irl_jax.files import read_table, write_table


def load_times(path: Path) -> dict[str, float]:
    """Seconds of each piece.

    Args:
        path: the table; it need not exist.

    Returns:
        Seconds by piece, of all calls so far.
    """
    if not path.exists():
        return {}
    rows = read_table(path)
    return dict(zip(rows["piece"], map(float, rows["seconds"]), strict=True))


@contextmanager
def timed(path: Path, piece: str) -> Iterator[None]:
    """Add the time of a block to a piece's, also where the block is interrupted.

    Args:
        path: the table.
        piece: name of the piece.

    Yields:
        Nothing.
    """
    start = time.perf_counter()
    try:
        yield
    finally:
        seconds = load_times(path)
        seconds[piece] = round(seconds.get(piece, 0.0) + time.perf_counter() - start, 1)
        write_table(path, {"piece": list(seconds), "seconds": list(seconds.values())})


def times_table(path: Path) -> list[str]:
    """The times as a table.

    Args:
        path: the table of `timed`; it need not exist.

    Returns:
        Lines of a Markdown table with the sum in its last row; none without times.
    """
    seconds = load_times(path)
    if not seconds:
        return []
    rows = [*seconds.items(), ("sum", sum(seconds.values()))]
    return ["| Piece | Minutes |", "|---|---:|", *(f"| {piece} | {total / 60:.1f} |" for piece, total in rows)]
