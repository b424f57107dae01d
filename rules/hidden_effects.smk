# The benchmark of hidden effects: made and sealed, diagnosed blind, scored (docs/records/hidden-effects.md). Cases are made and
# diagnosed in shares, each a job that resumes where it stopped: finished cases stay where they are. Cases of another plan, of
# other settings or of an earlier version are refused, not mixed with new ones: a sealed set is a record.

HIDDEN = SETTINGS.hidden_effects
HIDDEN_FOLDER = f"{RESULTS}/hidden_effects"
HIDDEN_SHARES = range(1, HIDDEN.shares + 1)
HIDDEN_PLAN = Path(HIDDEN.benchmark)  # a file, or the folder of one
HIDDEN_FILES = sorted(
    {
        os.path.relpath(path)
        for pattern in ("*.yaml", "*.py", "sections/*/*.yaml")
        for place in (Path(workflow.basedir, "benchmarks", "hidden_effects"), HIDDEN_PLAN)
        for path in place.glob(pattern)
    }
    | ({os.path.relpath(HIDDEN_PLAN)} if HIDDEN_PLAN.is_file() else set())
)


# How well each effect can be seen at all, so that none is planned that cannot be made.
rule plan_hidden:
    input:
        HIDDEN_FILES,
    output:
        f"{HIDDEN_FOLDER}/reach.json",
    log:
        f"{RESULTS}/logs/plan_hidden.log",
    benchmark:
        f"{RESULTS}/benchmarks/plan_hidden.tsv"
    threads: 1
    resources:
        mem_mb=3000,
        runtime=120,
    params:
        config=CONFIG_FILE,
        benchmark=HIDDEN.benchmark,
        folder=HIDDEN_FOLDER,
        physics=content_hash({"physics": CASE_PHYSICS, "settings": SETTINGS.simulation}),
    message:
        "How well can hidden effects be seen? {output}"
    shell:
        "python -m benchmarks.hidden_effects plan --benchmark {params.benchmark:q} --out {params.folder:q}"
        " --threads {threads} --config {params.config:q} > {log:q} 2>&1"


rule make_hidden:
    input:
        HIDDEN_FILES,
        reach=f"{HIDDEN_FOLDER}/reach.json",
    output:
        touch(f"{HIDDEN_FOLDER}/made_{{share}}.txt"),
    log:
        f"{RESULTS}/logs/make_hidden_{{share}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/make_hidden_{{share}}.tsv"
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: 3000 * attempt,
        runtime=lambda wildcards, attempt: 240 * attempt,
    params:
        config=CONFIG_FILE,
        benchmark=HIDDEN.benchmark,
        folder=HIDDEN_FOLDER,
        shares=HIDDEN.shares,
        physics=content_hash({"physics": CASE_PHYSICS, "settings": SETTINGS.simulation}),
    message:
        "Hiding effects, share {wildcards.share} of {params.shares}"
    shell:
        "python -m benchmarks.hidden_effects make --benchmark {params.benchmark:q} --out {params.folder:q}"
        " --part {wildcards.share}/{params.shares} --threads {threads} --config {params.config:q}"
        " > {log:q} 2>&1"


# The hashes of all truths, before any diagnosis.
rule seal_hidden:
    input:
        expand(f"{HIDDEN_FOLDER}/made_{{share}}.txt", share=HIDDEN_SHARES),
    output:
        f"{HIDDEN_FOLDER}/sealed.json",
    log:
        f"{RESULTS}/logs/seal_hidden.log",
    benchmark:
        f"{RESULTS}/benchmarks/seal_hidden.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        config=CONFIG_FILE,
        benchmark=HIDDEN.benchmark,
        folder=HIDDEN_FOLDER,
    message:
        "Sealing the truths: {output}"
    shell:
        "python -m benchmarks.hidden_effects make --benchmark {params.benchmark:q} --out {params.folder:q}"
        " --config {params.config:q} > {log:q} 2>&1"


rule diagnose_hidden:
    input:
        f"{HIDDEN_FOLDER}/sealed.json",
    output:
        touch(f"{HIDDEN_FOLDER}/diagnosed_{{share}}.txt"),
    log:
        f"{RESULTS}/logs/diagnose_hidden_{{share}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/diagnose_hidden_{{share}}.tsv"
    threads: 1
    resources:
        mem_mb=lambda wildcards, attempt: 3000 * attempt,
        runtime=lambda wildcards, attempt: 480 * attempt,
    params:
        config=CONFIG_FILE,
        folder=HIDDEN_FOLDER,
        shares=HIDDEN.shares,
        variants=",".join(HIDDEN.variants),
        physics=content_hash(
            {
                "physics": DIAGNOSIS_PHYSICS,
                "settings": [SETTINGS.simulation, SETTINGS.diagnosis],
            }
        ),
    message:
        "Diagnosing blind, share {wildcards.share} of {params.shares}"
    shell:
        "python -m benchmarks.hidden_effects run --out {params.folder:q} --variants {params.variants}"
        " --part {wildcards.share}/{params.shares} --threads {threads} --config {params.config:q}"
        " > {log:q} 2>&1"


rule hidden_effects:
    input:
        expand(f"{HIDDEN_FOLDER}/diagnosed_{{share}}.txt", share=HIDDEN_SHARES),
    output:
        f"{HIDDEN_FOLDER}/score.json",
    log:
        f"{RESULTS}/logs/hidden_effects.log",
    benchmark:
        f"{RESULTS}/benchmarks/hidden_effects.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=30,
    params:
        config=CONFIG_FILE,
        benchmark=HIDDEN.benchmark,
        folder=HIDDEN_FOLDER,
    message:
        "The score of the benchmark of hidden effects: {output}"
    shell:
        "python -m benchmarks.hidden_effects score --benchmark {params.benchmark:q} --out {params.folder:q}"
        " --config {params.config:q} > {log:q} 2>&1"
