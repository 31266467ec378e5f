"""`python -m relm_irl_jax` is the command `relm-irl`."""

from relm_irl_jax.cli import main

if __name__ == "__main__":
    main()
