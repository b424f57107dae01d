"""Commands about the configuration itself: `python -m pipeline check|schema`."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.cli import add_common, base_parser, main_exit
from pipeline.config import SCHEMA_FILE, config_hash, load_config, schema_text
from pipeline.files import yaml_text
from pipeline.schemas import add_schema_parser, run_schema


def main(argv: Sequence[str] | None = None) -> int:
    """Check a configuration, or print or write its JSON schema."""
    parser = base_parser("python -m pipeline", "The configuration: check it, print its schema.")
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser("check", help="check a configuration and print it whole, as YAML")
    add_common(check)
    add_schema_parser(commands, "the configuration", SCHEMA_FILE)
    arguments = parser.parse_args(argv)
    if arguments.command == "schema":
        return run_schema(arguments, SCHEMA_FILE, schema_text)
    return _check(arguments.config, arguments.overrides)


def _check(path: str | None, overrides: Sequence[str]) -> int:
    config = load_config(path, overrides)
    print(f"# config hash {config_hash(config)}")
    print(yaml_text(config.model_dump(mode="json")), end="")
    return 0


if __name__ == "__main__":
    main_exit(main)
