# The case histories: section -> runout, compared with what was measured. One target for each folder.


def case_files(wildcards):
    """The data of a case, and of cases whose sections it reads."""
    folder = CASE_FOLDER / wildcards.case
    return [path for place in (folder, *other_cases(folder)) for path in files_of(place)]


def other_cases(folder):
    """Folders of the cases on the way to a case's question."""
    question = folder / "inversion.yaml"
    waterfall = (read_yaml(question).get("waterfall") if question.is_file() else None) or {}
    named = {step.get("case") for step in waterfall.get("steps", [])} - {None, "."}
    places = (place if (place := folder / name).is_dir() else CASE_FOLDER / name for name in named)
    return sorted(place.resolve() for place in places)


def files_of(folder):
    """Everything in a case's folder but the text, and what a diagnosis alone reads."""
    return sorted(
        os.path.relpath(path)
        for path in folder.rglob("*")
        if path.is_file()
        and path.suffix != ".md"
        and path.name != "diagnosis.yaml"
        and not path.name.startswith(".")
    )


def case_folder(wildcards):
    """The folder of a case, as the programs take it."""
    return os.path.relpath(CASE_FOLDER / wildcards.case)


rule simulate_case:
    input:
        case_files,
    output:
        picture=report(
            f"{RESULTS}/{{case}}/simulation/runout.png",
            caption="captions/case.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "deposit and measured profile"},
        ),
        film=report(
            f"{RESULTS}/{{case}}/simulation/runout.mp4",
            caption="captions/case.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "film of the runout"},
        ),
        observables=f"{RESULTS}/{{case}}/simulation/observables.csv",
        summary=f"{RESULTS}/{{case}}/simulation/summary.txt",
    log:
        f"{RESULTS}/logs/simulate_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_{{case}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 2000 * attempt,
        runtime=lambda wildcards, attempt: 60 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.picture),
        case=case_folder,
        physics=content_hash({"physics": CASE_PHYSICS, "settings": SETTINGS.simulation}),
    message:
        "Simulating the case history {wildcards.case}"
    shell:
        "python -m flowslide simulate {params.case:q} --film mp4 --out {params.folder:q} --config {params.config:q}"
        " --threads {threads} > {output.summary:q} 2> {log:q}"


for target, case in [*CASE_ALIASES.items(), *((case, case) for case in CASES)]:

    rule:
        name:
            f"simulate_{target}"
        input:
            simulated_case(case),
        message:
            f"The case history {case} is simulated: {simulated_case(case)}"
