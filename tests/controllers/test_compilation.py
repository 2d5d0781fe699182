"""Compiled kernels are cached, and compiled anew when any kernel's source changed."""

import importlib.util
from pathlib import Path

import pytest
from numba import types

import flyrl
from flyrl.controllers import compilation

SOURCE = """
from numba import types
from flyrl.controllers.compilation import kernel, native_callback

@kernel
def double(x):
    return 2.0 * x

@native_callback(types.float64(types.float64))
def quadruple(x):
    return double(double(x))
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    path = tmp_path / "kernels.py"
    path.write_text(SOURCE)

    def load(digest):
        monkeypatch.setattr(compilation, "SOURCES_DIGEST", digest)
        spec = importlib.util.spec_from_file_location("kernels", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.double(1.5) == 3.0
        assert module.quadruple.ctypes(1.5) == 6.0
        return sum(module.double.stats.cache_hits.values()), module.quadruple.cache_hits

    return load


def test_unchanged_sources_load_from_the_cache_and_changed_ones_compile_anew(load):
    assert [load(digest) for digest in "aab"] == [(0, 0), (1, 1), (0, 0)]


def test_division_by_zero_raises_nothing():
    @compilation.native_callback(types.float64(types.float64))
    def invert(x):
        return 1.0 / x

    assert invert.ctypes(0.0) == float("inf")


def test_the_stamp_changes_with_any_source_of_the_packages_that_call_each_other(tmp_path):
    root = Path(flyrl.__file__).parent
    assert set(compilation.KERNEL_FOLDERS) == {root / "controllers", root / "muscles"}
    assert compilation.sources_digest(compilation.KERNEL_FOLDERS) == compilation.SOURCES_DIGEST
    folders = [tmp_path / name for name in ("controllers", "muscles")]
    for path in folders:
        path.mkdir()
    digests = {compilation.sources_digest(folders)}
    for path in folders:
        (path / "kernels.py").write_text("a = 1\n")
        digests.add(compilation.sources_digest(folders))
    assert len(digests) == 3
