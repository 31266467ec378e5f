"""Files that a user names."""

from pathlib import Path

from relm_irl_jax.errors import InputError


def refuse_device(path: Path) -> None:
    """Refuse a device, such as a terminal or `/dev/zero`, which may have no end. Pipes and missing files pass.

    Args:
        path: the file.

    Raises:
        InputError: it is a device.
    """
    if path.is_char_device() or path.is_block_device():
        raise InputError(f"{path}: is a device; give a file.")
