"""Imported before all else: where the compiled core is missing or broken, one line says how to install."""

try:
    # A checkout without the module has a folder of that name, which Python takes for an empty package.
    from voxkernel._core import StopFlag as StopFlag
except ImportError as error:
    from pathlib import Path  # not for those who have the core

    package = Path(__file__).resolve().parent
    if (package / "_core" / "CMakeLists.txt").exists():
        advice = (
            f"'{package}' is the source tree: start Python in another folder to use an installed voxkernel, or install "
            "this one with `pip install -e .`"
        )
    else:
        advice = "reinstall voxkernel, or install it with `pip install .` in a checkout"
    reason = str(error).replace("\n", " ")
    raise ImportError(f"the compiled core `voxkernel._core` cannot be loaded ({reason}); {advice}") from None
