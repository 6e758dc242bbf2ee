"""Imported before all else: where the compiled core is missing or broken, one line says how to install."""

try:
    # A checkout without the module has a folder of that name, which Python takes for an empty package.
    from voxkernel._core import StopFlag as StopFlag
except ImportError as error:
    reason = str(error).replace("\n", " ")
    raise ImportError(
        f"the compiled core `voxkernel._core` cannot be loaded ({reason}); install it with `pip install .` in a "
        "checkout, or reinstall voxkernel"
    ) from None
