"""`flowslide settings check`: a configuration, checked and printed whole."""

from __future__ import annotations

import argparse

from pipeline.cli import add_common

DESCRIPTION = "Check a configuration and print it whole, as YAML."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_common(parser)


def run(arguments: argparse.Namespace) -> None:
    """Check it, print it."""
    import yaml

    from pipeline.config import config_hash, load_config

    config = load_config(arguments.config, arguments.overrides)
    print(f"# config hash {config_hash(config)}")
    print(yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False), end="")
