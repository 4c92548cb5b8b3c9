"""Every public name is documented and typed, its examples run, and the stub fits the native module."""

import doctest
import importlib
import inspect
import pkgutil
import subprocess
import sys

import pytest
import scansion

MODULES = ["scansion"] + [
    f"scansion.{m.name}" for m in pkgutil.iter_modules(scansion.__path__) if m.name[0] != "_"
]
PRIVATE = [
    f"scansion.{m.name}"
    for m in pkgutil.iter_modules(scansion.__path__)
    if m.name not in ("_core", "__main__")
] + [f"scansion.nn.{m.name}" for m in pkgutil.iter_modules(scansion.nn.__path__)]


def public():
    """Name and object of everything that users are meant to call."""
    for name in MODULES:
        module = importlib.import_module(name)
        for member in getattr(module, "__all__", []):
            thing = getattr(module, member)
            if inspect.isfunction(thing):
                yield f"{name}.{member}", thing
            elif inspect.isclass(thing) and issubclass(
                thing, (scansion.PointCloud, scansion._base.Classifier)
            ):
                yield f"{name}.{member}", thing
                for key, method in inspect.getmembers(thing):
                    if key[0] != "_" and (inspect.isfunction(method) or inspect.ismethod(method)):
                        yield f"{name}.{member}.{key}", method
                    elif key[0] != "_" and isinstance(method, property):
                        yield f"{name}.{member}.{key}", method.fget


@pytest.mark.parametrize(("name", "thing"), list(public()))
def test_every_public_name_is_documented_and_typed(name, thing):
    assert inspect.getdoc(thing), f"{name} has no docstring"
    call = thing.__init__ if inspect.isclass(thing) else thing
    signature = inspect.signature(call)
    for parameter in signature.parameters.values():
        if parameter.name not in ("self", "cls", "deep", "parameters"):
            assert parameter.annotation is not inspect.Parameter.empty, (
                f"{name}: {parameter.name} is not annotated"
            )
            assert parameter.name in inspect.getdoc(thing), f"{name}: {parameter.name} is not documented"
    if not inspect.isclass(thing):
        assert signature.return_annotation is not inspect.Signature.empty, f"{name} has no return annotation"


@pytest.mark.parametrize("name", [name for name in MODULES if name != "scansion"])
def test_completion_offers_only_public_names(name):
    module = importlib.import_module(name)
    assert dir(module) == sorted(module.__all__)


@pytest.mark.parametrize("name", sorted(set(MODULES + PRIVATE)))
def test_examples_run(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_the_stub_fits_the_native_module():
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy.stubtest", "scansion._core", "--ignore-disjoint-bases"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
