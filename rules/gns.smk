# The learned simulator: trajectories -> packed data.


def packed_physics(wildcards):
    """Everything that decides the bytes of a data set, beside its trajectories."""
    return content_hash({"physics": GNS_PHYSICS, "settings": SETTINGS.gns.pack})


# A job that is killed leaves the shards that are whole in dataset/, which are no outputs, so that the next
# try keeps them. The metadata are written last.
rule pack_trajectories:
    input:
        trajectories=trajectories,
        failed=rules.list_runs.output.failed,
    output:
        dataset("{scale}"),
    log:
        f"{RESULTS}/logs/pack_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/pack_{{scale}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=lambda wildcards, attempt: 60 * attempt,
    params:
        config=CONFIG_FILE,
        folder=lambda wildcards, output: os.path.dirname(output[0]),
        physics=packed_physics,
    message:
        "Packing the runs of the scale {wildcards.scale}"
    shell:
        "python -m gns pack {input.trajectories} --scale {wildcards.scale} --out {params.folder}"
        " --leave-out {input.failed} --config {params.config} > {log} 2>&1"


for scale in SETTINGS.scales:

    rule:
        name:
            f"pack_{scale}"
        input:
            dataset(scale),
        message:
            f"The scale {scale} is packed: {dataset(scale)}"
