# Back-analysis: measured runout -> strength, by the material point method and the classical methods. One
# target for each folder of case_histories/ that has a question (inversion.yaml).


def has_profile(case):
    """A surface after the slide was measured or drawn, which the classical methods need."""
    if (CASE_FOLDER / case / "classical.yaml").is_file():
        return True
    document = yaml.safe_load((CASE_FOLDER / case / "measurements.yaml").read_text("utf-8"))
    return any(
        entry.get("type") == "surface_profile"
        for entries in document["sets"].values()
        for entry in entries
    )


def classical_result(wildcards):
    """What the classical methods say, where they can say anything."""
    if not has_profile(wildcards.case):
        return []
    return f"{RESULTS}/{wildcards.case}/classical/classical.json"


rule classical_case:
    input:
        case_files,
    output:
        f"{RESULTS}/{{case}}/classical/classical.json",
    log:
        f"{RESULTS}/logs/classical_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/classical_{{case}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        folder=lambda wildcards, output: os.path.dirname(output[0]),
        case=lambda wildcards, input: os.path.dirname(input[0]),
        physics=content_hash(INVERSION_PHYSICS),
    message:
        "Kinetics, ZIF and IMM on the case history {wildcards.case}"
    shell:
        "python -m inversion classical {params.case} --out {params.folder} > {log} 2>&1"


# A job that is killed leaves its simulations in inversion/runs, which is no output, so that the next try
# continues from them.
rule invert_case:
    input:
        case_files,
        classical=classical_result,
    output:
        result=f"{RESULTS}/{{case}}/inversion/result.json",
        history=f"{RESULTS}/{{case}}/inversion/history.csv",
        sections=f"{RESULTS}/{{case}}/inversion/sections.npz",
        run=f"{RESULTS}/{{case}}/inversion/run.h5",
        summary=f"{RESULTS}/{{case}}/inversion/summary.txt",
        page=report(
            f"{RESULTS}/{{case}}/inversion/report.html",
            caption="../report/inversion.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "back-analysis"},
        ),
    log:
        f"{RESULTS}/logs/invert_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/invert_{{case}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 120 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.result),
        case=lambda wildcards, input: os.path.dirname(input[0]),
        physics=content_hash(
            {
                "physics": INVERSION_PHYSICS,
                "settings": [SETTINGS.simulation, SETTINGS.inversion],
            }
        ),
    message:
        "Back-analysis of the case history {wildcards.case}"
    shell:
        "python -m inversion invert {params.case} --out {params.folder} --config {params.config}"
        " --threads {threads} > {output.summary} 2> {log}"


for target, case in [*CASE_ALIASES.items(), *((case, case) for case in QUESTIONS)]:
    if case in QUESTIONS:

        rule:
            name:
                f"invert_{target}"
            input:
                inverted_case(case),
            message:
                f"The case history {case} is back-analysed: {inverted_case(case)}"
