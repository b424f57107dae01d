# The learned simulator: trajectories -> packed data -> trained model -> what it is worth.


def packed_physics(wildcards):
    """Everything that decides the bytes of a data set, in addition to its trajectories."""
    return content_hash({"physics": GNS_PHYSICS, "settings": SETTINGS.gns.pack})


# A job that is killed leaves the complete shards in dataset/, which are not outputs, so that the next
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
        "python -m flowslide gns pack {input.trajectories:q} --scale {wildcards.scale} --out {params.folder:q}"
        " --leave-out {input.failed:q} --config {params.config:q} > {log:q} 2>&1"


def learned_physics(wildcards):
    """Everything that decides a model, in addition to its data."""
    settings = SETTINGS.training_for(wildcards.scale)
    return content_hash({"physics": GNS_PHYSICS, "settings": settings})


# A job that is killed leaves the state of the training in model/, which is not an output, so that the next try
# goes on from it; nor is the best model so far. The output says that the last step was taken.
rule train_model:
    input:
        dataset("{scale}"),
    output:
        trained("{scale}"),
    log:
        f"{RESULTS}/logs/train_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train_{{scale}}.tsv"
    threads: 2
    resources:
        mem_mb=lambda wildcards, attempt: 8000 * attempt,
        runtime=lambda wildcards, attempt: 1440 * attempt,
        gpu=0,
    params:
        config=CONFIG_FILE,
        data=lambda wildcards, input: os.path.dirname(input[0]),
        folder=lambda wildcards, output: os.path.dirname(output[0]),
        physics=learned_physics,
    message:
        "Learning from the runs of the scale {wildcards.scale}"
    # One process for each GPU; without one, a process for each thread, which share a batch.
    shell:
        "if [ {resources.gpu} -gt 0 ]; then how='--device cuda --processes {resources.gpu}';"
        " else how='--device cpu --joint-batch --processes {threads} --threads 1'; fi;"
        " python -m flowslide gns train --scale {wildcards.scale} --data {params.data:q} --out {params.folder:q}"
        " --start-over $how --config {params.config:q} > {output:q} 2> {log:q}"


rule evaluate_model:
    input:
        dataset("{scale}"),
        trained("{scale}"),
        runs=statistics("{scale}"),
    output:
        card=f"{RESULTS}/{{scale}}/model/card.yaml",
        table=f"{RESULTS}/{{scale}}/model/evaluation.csv",
        summary=f"{RESULTS}/{{scale}}/model/evaluation.txt",
        worst=report(
            f"{RESULTS}/{{scale}}/model/worst.png",
            caption="captions/model.rst",
            category="Learned simulators",
            labels={"scale": "{scale}", "what": "the five worst rollouts"},
        ),
        training=report(
            f"{RESULTS}/{{scale}}/model/training.png",
            caption="captions/model.rst",
            category="Learned simulators",
            labels={"scale": "{scale}", "what": "history of the training"},
        ),
    log:
        f"{RESULTS}/logs/evaluate_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/evaluate_{{scale}}.tsv"
    threads: 2
    resources:
        mem_mb=4000,
        runtime=lambda wildcards, attempt: 240 * attempt,
    params:
        config=CONFIG_FILE,
        data=lambda wildcards, input: os.path.dirname(input[0]),
        folder=lambda wildcards, output: os.path.dirname(output.card),
        physics=content_hash(GNS_PHYSICS),
    message:
        "Judging the model of the scale {wildcards.scale} on held-out runs"
    shell:
        "python -m flowslide gns evaluate --scale {wildcards.scale} --data {params.data:q}"
        " --model {params.folder:q} --mpm {input.runs:q} --threads {threads}"
        " --config {params.config:q} > {output.summary:q} 2> {log:q}"


for scale in SETTINGS.scales:

    rule:
        name:
            f"pack_{scale}"
        input:
            dataset(scale),
        message:
            f"The scale {scale} is packed: {dataset(scale)}"

    rule:
        name:
            f"train_{scale}"
        input:
            trained(scale),
            evaluated(scale),
        message:
            f"A simulator has learned from the scale {scale}: {evaluated(scale)}"

    rule:
        name:
            f"evaluate_{scale}"
        input:
            evaluated(scale),
        message:
            f"The model of the scale {scale} is judged: {evaluated(scale)}"
