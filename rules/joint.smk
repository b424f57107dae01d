# One relation of the strength ratio over several slides: their back-analyses and verdicts -> its median and scatter.


def joint_inputs(wildcards):
    """Back-analysis and verdict of every slide; of one from a few numbers its posterior."""
    if unknown := [case for case in SETTINGS.joint.cases if case not in QUESTIONS]:
        raise WorkflowError(
            f"configuration: joint: cases: {', '.join(unknown)}: no question in case_histories/"
        )
    drawn = [case for case in SETTINGS.joint.cases if case not in FAMILIES]
    return [
        *(file(case) for file in (inverted_case, diagnosed_case) for case in drawn),
        *(posterior_of_case(case) for case in SETTINGS.joint.cases if case in FAMILIES),
    ]


# A posterior that a drawn case has as well is read in place of its back-analysis; it is made by hand.
rule joint:
    input:
        joint_inputs,
    output:
        result=f"{RESULTS}/joint/joint.json",
        summary=f"{RESULTS}/joint/summary.txt",
        page=report(
            f"{RESULTS}/joint/report.html",
            caption="captions/joint.rst",
            category="Case histories",
            labels={"case": "several", "what": "joint relation"},
        ),
    log:
        f"{RESULTS}/logs/joint.log",
    benchmark:
        f"{RESULTS}/benchmarks/joint.tsv"
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: 2000 * attempt,
        runtime=lambda wildcards, attempt: 20 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.result),
        cases=lambda wildcards: [str(CASE_FOLDER / case) for case in SETTINGS.joint.cases],
        physics=content_hash({"physics": INVERSION_PHYSICS, "settings": [SETTINGS.posterior]}),
    message:
        "One relation of the strength ratio over {SETTINGS.joint.cases}"
    shell:
        "python -m flowslide joint {params.cases:q} --out {params.folder:q}"
        " --config {params.config:q} > {log:q} 2>&1"
