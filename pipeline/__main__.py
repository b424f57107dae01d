"""Commands about the configuration itself: `python -m pipeline check|schema`."""

from __future__ import annotations

from collections.abc import Sequence

import yaml

from pipeline.cli import add_common, base_parser, main_exit
from pipeline.config import SCHEMA_FILE, config_hash, load_config, schema_text
from pipeline.files import write_text


def main(argv: Sequence[str] | None = None) -> int:
    """Check a configuration, or print or write its JSON schema."""
    parser = base_parser("python -m pipeline", "The configuration: check it, print its schema.")
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser("check", help="check a configuration and print it whole, as YAML")
    add_common(check)
    schema = commands.add_parser("schema", help="print the JSON schema of the configuration")
    schema.add_argument(
        "--write", action="store_true", help=f"write it to {SCHEMA_FILE} instead of printing it"
    )
    arguments = parser.parse_args(argv)
    if arguments.command == "schema":
        return _schema(write=arguments.write)
    return _check(arguments.config, arguments.overrides)


def _check(path: str | None, overrides: Sequence[str]) -> int:
    config = load_config(path, overrides)
    print(f"# config hash {config_hash(config)}")
    print(yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False), end="")
    return 0


def _schema(*, write: bool) -> int:
    if write:
        write_text(SCHEMA_FILE, schema_text())
        print(f"wrote {SCHEMA_FILE}")
    else:
        print(schema_text(), end="")
    return 0


if __name__ == "__main__":
    main_exit(main)
