"""The command `relm-irl`, also as `python -m relm_irl_jax`."""

from relm_irl_jax.interruption import exit_interrupted, interruptible


def main() -> None:
    """Run the command; an interruption ends it in a sentence at any time, also while its modules are imported."""
    try:
        with interruptible(until_exit=True):
            from relm_irl_jax.cli import main as command

            command()
    except KeyboardInterrupt as error:
        exit_interrupted(error)


if __name__ == "__main__":
    main()
