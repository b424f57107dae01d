# The material point method: scenes -> trajectories -> which runs went well.


def simulation_physics(wildcards):
    """Everything that decides the numbers of a batch, in addition to its scenes."""
    return content_hash({"physics": PHYSICS, "settings": SETTINGS.simulation_for(wildcards.scale)})


# A job that is killed leaves its finished runs in trajectories/.batch_BBB.parts, which is not an output,
# so that the next try continues from them.
rule simulate_batch:
    input:
        rules.sample_scenes.output,
    output:
        f"{RESULTS}/{{scale}}/trajectories/batch_{{batch}}.h5",
    log:
        f"{RESULTS}/logs/simulate_{{scale}}_{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_{{scale}}_{{batch}}.tsv"
    threads: 4
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=lambda wildcards, attempt: 120 * attempt,
        gpu=0,
    params:
        config=CONFIG_FILE,
        scenes=f"{RESULTS}/{{scale}}/scenes",
        folder=f"{RESULTS}/{{scale}}/trajectories",
        device=lambda wildcards, resources: "cuda" if resources.gpu else "cpu",
        indices=batch_indices,
        physics=simulation_physics,
    message:
        "Simulating runs {params.indices} of the scale {wildcards.scale} on the {params.device}"
    shell:
        "python -m flowslide scenes simulate --scale {wildcards.scale} --batch {wildcards.batch}"
        " --scenes {params.scenes:q} --out {params.folder:q} --config {params.config:q}"
        " --device {params.device} --threads {threads} > {log:q} 2>&1"


rule list_runs:
    input:
        trajectories,
    output:
        table=statistics("{scale}"),
        failed=f"{RESULTS}/{{scale}}/failed.txt",
        picture=report(
            f"{RESULTS}/{{scale}}/runs.png",
            caption="captions/runs.rst",
            category="Simulations",
            labels={"scale": "{scale}", "what": "statistics of the runs"},
        ),
        page=report(
            f"{RESULTS}/{{scale}}/runs.html",
            caption="captions/runs.rst",
            category="Simulations",
            labels={"scale": "{scale}", "what": "table of the runs"},
        ),
    log:
        f"{RESULTS}/logs/list_runs_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/list_runs_{{scale}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=20,
    params:
        script=f"{workflow.basedir}/rules/scripts/run_statistics.py",
    message:
        "Listing the runs of the scale {wildcards.scale} and those that failed"
    shell:
        "(python -m flowslide runs status {input:q} --csv {output.table:q}"
        " && python {params.script:q} {output.table:q} --name {wildcards.scale}"
        " --failed {output.failed:q} --picture {output.picture:q} --page {output.page:q}) > {log:q} 2>&1"


for scale in SETTINGS.scales:

    rule:
        name:
            f"simulate_{scale}"
        input:
            statistics(scale),
            batch_files(scale, "trajectories", "h5"),
        message:
            f"The scale {scale} is simulated: {statistics(scale)}"
