"""The Python interface: what `import relm_irl_jax` offers.

    import relm_irl_jax as relm
    scenes = relm.rooms("bathroom-0", "bedroom-0")
    trained = relm.train(scenes, reward=lambda t: 10 * t.arrived - 0.1 * t.collided - 0.01, frames="300k")
    trained.plot()
    relm.compare(relm.evaluate("random", scenes=scenes), relm.evaluate(trained, task="II"))

These five functions and what they return stay as they are; everything below them may change.
"""
