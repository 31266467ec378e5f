"""Workers over eight virtual devices: the same numbers as on one."""

import os
import subprocess
import sys
import textwrap

PROGRAM = textwrap.dedent("""
    import jax, numpy as np
    from test_update import STEP_COST, room
    from relm_irl_jax.agent.settings import SiameseSettings
    from relm_irl_jax.agent.siamese.train import train

    assert jax.device_count() == 8
    world, targets = room()
    settings = SiameseSettings(workers=32, t_max=4, width=8)
    runs = [
        train(jax.random.key(5), world, targets, STEP_COST, 10.0, 2, settings, 20, 4096, devices=jax.devices()[:count])
        for count in (1, 8)
    ]
    for (one, _), (eight, _) in [runs]:
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(eight), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-5)
    assert len(jax.tree.leaves(runs[1][0])[0].sharding.device_set) == 8
    np.testing.assert_allclose(runs[0][1].episodes, runs[1][1].episodes)
""")


def test_one_and_eight_devices_agree():
    here = os.path.dirname(__file__)
    environment = os.environ | {
        "XLA_FLAGS": "--xla_force_host_platform_device_count=8",
        "JAX_PLATFORMS": "cpu",
        "PYTHONPATH": os.pathsep.join([here, os.path.dirname(here)]),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
