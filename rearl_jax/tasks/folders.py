"""Folders of the files that come with the package: configuration and sweeps."""

from pathlib import Path


def conf_dir() -> Path:
    """The folder of the configuration files: inside the package in a wheel, next to it in a checkout.

    Raises:
        FileNotFoundError: Neither exists, because the installation is incomplete.
    """
    return _shipped_folder("conf")


def sweeps_dir() -> Path:
    """The folder of the sweep files, next to that of `conf_dir`.

    Raises:
        FileNotFoundError: The folder does not exist, because the installation is incomplete.
    """
    return _shipped_folder("sweeps")


def _shipped_folder(name: str) -> Path:
    package = Path(__file__).resolve().parents[1]
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"{package / name} is missing: incomplete installation, install again")
