"""`flowslide report CASE|FOLDER`: results printed again, their page rewritten, and a PDF of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from flowslide.commands import options
from pipeline.cli import InputError, add_common

if TYPE_CHECKING:
    from inversion.back_analysis.result import Result

FILE_NAME = "result.json"


DESCRIPTION = (
    "Print the tables of a back-analysis, a posterior, a joint relation or a diagnosis that is "
    "done, and write its report.html and pictures again; with --pdf, print that page. Nothing is "
    "simulated."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument(
        "case",
        metavar="CASE|FOLDER",
        help="name or folder of a case that was back-analysed, or a folder of results",
    )
    parser.add_argument(
        "--case",
        dest="case_folder",
        metavar="DIR",
        help="folder of the case, where it is not in case_histories",
    )
    parser.add_argument(
        "--report",
        choices=("film", "page", "none"),
        default="page",
        help="film: page with a new film; page: with the film that is there; none; default: page",
    )
    parser.add_argument(
        "--pdf", action="store_true", help="print the page by Chromium or Chrome into report.pdf"
    )
    options.add_measurements_code(parser)
    add_common(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the tables; write the page, and print it."""
    page = _other(arguments) or _back_analysis(arguments)
    if arguments.report != "none" and not arguments.quiet:
        print(f"wrote {page}")
    if arguments.pdf:
        from report.pdf import write_pdf

        printed = write_pdf(page)
        if not arguments.quiet:
            print(f"wrote {printed}")
    return 0


def _back_analysis(arguments: argparse.Namespace) -> Path:
    from inversion.back_analysis.result import load_result
    from pipeline.config import load_config
    from report.back_analysis import PAGE, summary, write_report
    from report.data.back_analysis import load_back_analysis

    results = load_config(arguments.config, arguments.overrides).results_folder
    folder, case = folders(arguments.case, results)
    if arguments.case_folder is not None:
        check_case(arguments.case_folder, load_result(folder))
    data = load_back_analysis(folder, arguments.case_folder or case)
    print(summary(data))
    if arguments.report == "none":
        return folder / PAGE
    return write_report(data, film=arguments.report == "film")


def _other(arguments: argparse.Namespace) -> Path | None:
    """The page of a posterior, a joint relation or a diagnosis; None: the folder has none."""
    from report.of_folder import answered

    known = answered(Path(arguments.case))
    if known is None:
        return None
    print(known.summary())
    return known.page if arguments.report == "none" else known.write()


def check_case(given: str, result: Result) -> None:
    """The folder of --case is that of the case which a result answers, checked by its name.

    Raises:
        InputError: there is no such folder, or it is of another case.
    """
    folder = Path(given)
    if not folder.is_dir():
        raise InputError(f"--case {given}: no such folder")
    if folder.resolve().name != result.case:
        raise InputError(
            f"--case {given}: the result answers {result.case!r}; its measurements are in a folder "
            "of that name"
        )


def folders(text: str, results: str | Path = "results") -> tuple[Path, Path | None]:
    """The folder of a result, and that of its case where the text names it.

    Args:
        text: a folder with a result, a case folder, or the name of a case.
        results: where results are kept.

    Raises:
        InputError: nothing of that name has been back-analysed.
    """
    path = Path(text)
    if (path / FILE_NAME).is_file():
        return path, None
    found = Path(results) / path.resolve().name / "inversion"
    if not (found / FILE_NAME).is_file():
        raise InputError(
            f"{text}: neither a folder with a {FILE_NAME} nor a case that has {found}/{FILE_NAME}; "
            f"ask first: flowslide invert {text}"
        )
    return found, path if (path / "scene.yaml").is_file() else None
