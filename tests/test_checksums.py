"""A flipped bit in anything that is kept is noticed, and what can be computed again is computed again."""

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relm_irl_jax.errors import InputError
from relm_irl_jax.features import cache as features_cache
from relm_irl_jax.features.cache import encode_cached
from relm_irl_jax.features.encoder import Encoder
from relm_irl_jax.files import has_checksum, load_arrays_and_metadata, save_arrays, write_checksum
from relm_irl_jax.scenes.rooms import cache as room_cache
from relm_irl_jax.scenes.rooms.cache import built_in_room

FLIPS = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def flip(path, share, bit):
    content = bytearray(path.read_bytes())
    content[int(share * len(content))] ^= 1 << bit
    path.write_bytes(content)


def test_equal_contents_are_equal_files(tmp_path):
    strings = dict.fromkeys("zyxwabc", "x")
    for number in range(10):
        save_arrays(tmp_path / str(number), {"b": np.ones(2), "a": np.zeros(3)}, strings)
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 1


def test_a_flipped_bit_of_every_byte_of_a_file_of_arrays_is_noticed(tmp_path):
    path = tmp_path / "a.safetensors"
    arrays = {"x": np.arange(3, dtype=np.float32), "y": np.ones((1, 2))}
    save_arrays(path, arrays, {"note": "n"})
    content = path.read_bytes()
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ (1 << place % 8)]) + content[place + 1 :])
        try:
            read, metadata = load_arrays_and_metadata(path)
        except InputError:
            continue
        # Blanks of the header may change without changing its contents.
        assert metadata == {"note": "n"}
        assert set(read) == {"x", "y"}
        assert all((read[name] == arrays[name]).all() and read[name].dtype == arrays[name].dtype for name in arrays)


@FLIPS
@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7), data=st.booleans())
def test_a_flipped_bit_of_a_file_or_of_its_checksum_is_noticed(tmp_path, share, bit, data):
    path = tmp_path / "a.h5"
    path.write_bytes(bytes(range(256)))
    assert not has_checksum(tmp_path / "absent")
    write_checksum(path)
    assert has_checksum(path)
    flip(path if data else path.with_name("a.h5.sha256"), share, bit)
    assert not has_checksum(path)


@pytest.fixture(scope="module")
def room():
    return built_in_room("bathroom", 0, size="tiny", image_size=32)


@FLIPS
@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_of_a_room_means_rendering_again(tmp_path_factory, room, share, bit):
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room_cache, "cache_folder", lambda: folder)
        rendered = []
        patch.setattr("relm_irl_jax.scenes.rooms.generate.generate_room", lambda *_, **__: rendered.append(1) or room)
        for _ in range(2):
            built_in_room("bathroom", 0, size="tiny", image_size=32)
        assert len(rendered) == 1
        (path,) = folder.rglob("*.h5")
        flip(path, share, bit)
        for views in (False, True):
            again = built_in_room("bathroom", 0, size="tiny", image_size=32, views=views)
            assert (again.graph == room.graph).all()
        assert len(rendered) == 2
        np.testing.assert_array_equal(again.views, room.views)


def test_a_room_that_is_removed_while_it_is_read_is_generated(tmp_path, room, monkeypatch):
    monkeypatch.setattr(room_cache, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr("relm_irl_jax.scenes.rooms.generate.generate_room", lambda *_, **__: room)
    built_in_room("bathroom", 0, size="tiny", image_size=32)
    (path,) = tmp_path.rglob("*.h5")

    def verified_then_removed(file):
        file.unlink(missing_ok=True)
        return True

    monkeypatch.setattr(room_cache, "has_checksum", verified_then_removed)
    assert built_in_room("bathroom", 0, size="tiny", image_size=32).n_states == room.n_states
    assert path.exists()


@FLIPS
@given(share=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_of_features_means_encoding_again(tmp_path_factory, share, bit):
    folder = tmp_path_factory.mktemp("cache")
    views = np.zeros((1, 4, 4, 3), np.uint8)
    features = np.arange(2048, dtype=np.float32)[None]
    encoder = Encoder("resnet50", {}, "by hand", "0", 4)
    with pytest.MonkeyPatch.context() as patch:
        encoded = []
        patch.setattr(features_cache, "encode", lambda *_: encoded.append(1) or features)
        encode_cached(views, encoder, folder)
        (path,) = folder.glob("*.safetensors")
        before = path.read_bytes()
        flip(path, share, bit)
        np.testing.assert_array_equal(encode_cached(views, encoder, folder), features)
        np.testing.assert_array_equal(encode_cached(views, encoder, folder), features)
        assert len(encoded) <= 2
        if len(encoded) == 2:
            assert path.read_bytes() == before


def compile_and_flip(folder, generator):
    assert jax.jit(lambda x: x * np.float32(3))(np.float32(2)) == 6  # a new function, the same program
    for path in folder.glob("*-cache"):
        flip(path, generator.uniform(), int(generator.integers(8)))


def test_a_flipped_bit_of_a_compiled_program_means_compiling_again(tmp_path):
    """JAX compresses what it keeps; the compression's checksum covers the whole program."""
    generator = np.random.default_rng(0)
    keep = {
        "jax_compilation_cache_dir": str(tmp_path),
        "jax_persistent_cache_min_compile_time_secs": 0,
        "jax_persistent_cache_min_entry_size_bytes": -1,
    }
    before = {name: getattr(jax.config, name) for name in keep}
    from jax.experimental.compilation_cache import compilation_cache

    try:
        for name, value in keep.items():
            jax.config.update(name, value)
        compilation_cache.reset_cache()
        compile_and_flip(tmp_path, generator)
        for _ in range(6):
            with pytest.warns(UserWarning, match="reading persistent compilation cache"):
                compile_and_flip(tmp_path, generator)
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
        compilation_cache.reset_cache()
