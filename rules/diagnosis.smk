# Missing physics: measurements -> verdict, by the material point method. One target for each folder of
# case_histories/ that has a question (inversion.yaml).


def diagnosis_files(wildcards):
    """The data of a case, with what an engineer knows of its effects, and of the case that judges it."""
    known = CASE_FOLDER / wildcards.case / "diagnosis.yaml"
    if not known.is_file():
        return case_files(wildcards)
    found = [*case_files(wildcards), os.path.relpath(known)]
    judge = read_yaml(known).get("validation_case")
    if judge:
        place = (known.parent / judge).resolve()
        own = place / "diagnosis.yaml"
        found += [*files_of(place), *([os.path.relpath(own)] if own.is_file() else [])]
    return found


# A job that is killed leaves its simulations in diagnosis/runs, which is not an output, so that the next try
# continues from them.
rule diagnose_case:
    input:
        diagnosis_files,
    output:
        verdict=f"{RESULTS}/{{case}}/diagnosis/verdict.json",
        sections=f"{RESULTS}/{{case}}/diagnosis/sections.npz",
        summary=f"{RESULTS}/{{case}}/diagnosis/summary.txt",
        page=report(
            f"{RESULTS}/{{case}}/diagnosis/report.html",
            caption="captions/diagnosis.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "missing physics"},
        ),
    log:
        f"{RESULTS}/logs/diagnose_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/diagnose_{{case}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 120 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.verdict),
        case=case_folder,
        physics=content_hash(
            {
                "physics": DIAGNOSIS_PHYSICS,
                "settings": [SETTINGS.simulation, SETTINGS.diagnosis],
            }
        ),
    message:
        "Which effect is missing in the model of the case history {wildcards.case}"
    shell:
        "python -m flowslide diagnose run {params.case:q} --out {params.folder:q} --config {params.config:q}"
        " --threads {threads} > {output.summary:q} 2> {log:q}"


for target, case in [*CASE_ALIASES.items(), *((case, case) for case in QUESTIONS)]:
    if case in QUESTIONS:

        rule:
            name:
                f"diagnose_{target}"
            input:
                diagnosed_case(case),
            message:
                f"The case history {case} is diagnosed: {diagnosed_case(case)}"
