"""`flowslide schema`: the JSON schemas of the documents, for editors and other tools."""

from __future__ import annotations

import argparse
from importlib import import_module

DOCUMENTS = {
    "settings": ("config/config.schema.json", "pipeline.config"),
    "result": ("config/result.schema.json", "inversion.back_analysis.result"),
    "posterior": ("config/posterior.schema.json", "inversion.posterior.document"),
    "joint": ("config/joint.schema.json", "inversion.joint.document"),
    "verdict": ("config/verdict.schema.json", "diagnosis.verdict.verdict"),
    "card": ("config/card.schema.json", "gns.evaluation.card"),
}
"""Document -> file of its schema, made and not kept, and the module that has `schema_text()`."""

DESCRIPTION = (
    "Print the JSON schema of the settings, of result.json (back-analysis), of posterior.json, "
    "of joint.json, of verdict.json (diagnosis) or of card.yaml (learned simulator)."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "document",
        nargs="?",
        choices=tuple(DOCUMENTS),
        default="settings",
        help="default: settings",
    )
    parser.add_argument(
        "--write", action="store_true", help="write it to config/, where an editor finds it"
    )


def run(arguments: argparse.Namespace) -> None:
    """Print or write it."""
    from pipeline.files import write_text

    file, module = DOCUMENTS[arguments.document]
    text = import_module(module).schema_text()
    if arguments.write:
        write_text(file, text)
        print(f"wrote {file}")
    else:
        print(text, end="")
