# Back-analysis: measured runout -> strength, by the material point method, the classical methods and, where
# there is a model, the learned simulator. One target for each folder of case_histories/ that has a
# question (inversion.yaml).


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
        result=f"{RESULTS}/{{case}}/classical/classical.json",
        summary=f"{RESULTS}/{{case}}/classical/summary.txt",
    log:
        f"{RESULTS}/logs/classical_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/classical_{{case}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=20,
    params:
        folder=lambda wildcards, output: os.path.dirname(output.result),
        case=case_folder,
        physics=content_hash(INVERSION_PHYSICS),
    message:
        "Kinetics, ZIF and IMM on the case history {wildcards.case}"
    shell:
        "python -m flowslide classical {params.case:q} --out {params.folder:q} > {output.summary:q} 2> {log:q}"


# A job that is killed leaves its simulations in inversion/runs, which is not an output, so that the next try
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
            caption="captions/inversion.rst",
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
        case=case_folder,
        physics=content_hash(
            {
                "physics": INVERSION_PHYSICS,
                "settings": [SETTINGS.simulation, SETTINGS.inversion],
            }
        ),
    message:
        "Back-analysis of the case history {wildcards.case}"
    shell:
        "python -m flowslide invert {params.case:q} --engine mpm --out {params.folder:q}"
        " --config {params.config:q} --threads {threads} > {output.summary:q} 2> {log:q}"


def model_at_hand():
    """Folder of the model that also answers: inversion.model, else the one that ships; None: none."""
    models = Path(workflow.basedir) / "models"
    text = SETTINGS.inversion.model or "thrust"
    for folder in (Path(text), models / text):
        if (folder / "model.pt").is_file():
            return folder
    if SETTINGS.inversion.model:
        raise WorkflowError(
            f"configuration: inversion.model: {text}: no folder with model.pt of that name, nor in models/"
        )
    return None


MODEL_AT_HAND = model_at_hand()


# After the material point method's own answer, so that its page has all of them in one table. The answer
# alone: what else moves it is asked of the material point method, above. It is asked for far outside the
# training as well, since the material point method judges it; its remarks state the distance.
rule invert_case_gns:
    input:
        case_files,
        own=f"{RESULTS}/{{case}}/inversion/result.json",
        model=[] if MODEL_AT_HAND is None else MODEL_AT_HAND / "model.pt",
    output:
        result=f"{RESULTS}/{{case}}/inversion_gns/result.json",
        history=f"{RESULTS}/{{case}}/inversion_gns/history.csv",
        sections=f"{RESULTS}/{{case}}/inversion_gns/sections.npz",
        run=f"{RESULTS}/{{case}}/inversion_gns/run.h5",
        summary=f"{RESULTS}/{{case}}/inversion_gns/summary.txt",
        page=report(
            f"{RESULTS}/{{case}}/inversion_gns/report.html",
            caption="captions/inversion.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "back-analysis, Diff-GNS"},
        ),
    log:
        f"{RESULTS}/logs/invert_case_gns_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/invert_case_gns_{{case}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 120 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.result),
        case=case_folder,
        model=MODEL_AT_HAND,
        physics=content_hash(
            {
                "physics": {**INVERSION_PHYSICS, **GNS_PHYSICS},
                "settings": [SETTINGS.simulation, SETTINGS.inversion],
            }
        ),
    message:
        "Back-analysis of the case history {wildcards.case} by a learned simulator"
    shell:
        "python -m flowslide invert {params.case:q} --engine gns --model {params.model:q}"
        " --out {params.folder:q} --config {params.config:q} --threads {threads} --quick"
        " --set inversion.outside_training=true"
        " > {output.summary:q} 2> {log:q}"


# Everything that the question leaves unknown, before and after the measurements. A job that is killed leaves its
# simulations in posterior/runs.
rule posterior_case:
    input:
        case_files,
    output:
        result=f"{RESULTS}/{{case}}/posterior/posterior.json",
        draws=f"{RESULTS}/{{case}}/posterior/posterior.nc",
        summary=f"{RESULTS}/{{case}}/posterior/summary.txt",
        page=report(
            f"{RESULTS}/{{case}}/posterior/report.html",
            caption="captions/posterior.rst",
            category="Case histories",
            labels={"case": "{case}", "what": "posterior"},
        ),
    log:
        f"{RESULTS}/logs/posterior_{{case}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/posterior_{{case}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 120 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output.result),
        case=case_folder,
        physics=content_hash(
            {
                "physics": INVERSION_PHYSICS,
                "settings": [SETTINGS.simulation, SETTINGS.inversion, SETTINGS.posterior],
            }
        ),
    message:
        "Posterior of the case history {wildcards.case}"
    shell:
        "python -m flowslide posterior {params.case:q} --out {params.folder:q}"
        " --config {params.config:q} --threads {threads} > {output.summary:q} 2> {log:q}"


def answered_case(case):
    """Results of every engine available."""
    found = [inverted_case(case)]
    if MODEL_AT_HAND is not None:
        found.append(f"{RESULTS}/{case}/inversion_gns/result.json")
    return found


# `answer_...`: by the material point method, the classical methods next to it, in minutes. `invert_...`: by
# the learned simulator as well, if there is one.
for target, case in [*CASE_ALIASES.items(), *((case, case) for case in QUESTIONS)]:
    if case in QUESTIONS:

        rule:
            name:
                f"answer_{target}"
            input:
                inverted_case(case),
            message:
                f"The strengths of the case history {case} by simulation: {inverted_case(case)}"

        rule:
            name:
                f"invert_{target}"
            input:
                answered_case(case),
            message:
                f"The case history {case} is back-analysed: {inverted_case(case)}"

        rule:
            name:
                f"posterior_{target}"
            input:
                posterior_of_case(case),
            message:
                f"The posterior of the case history {case}: {posterior_of_case(case)}"
