# The learned model without steps: runs of random sections -> a trained model with its card.

DIRECT_PARTS = 1000
DIRECT_NETWORKS = 2


wildcard_constraints:
    part=r"\d\d\d\d",
    network=r"\d",


def direct_runs(wildcards):
    return [f"{RESULTS}/direct/runs/runs_{part:04d}.npz" for part in range(DIRECT_PARTS)]


# A part is written when whole: a job that is killed costs at most its own fifty runs.
rule simulate_direct:
    output:
        f"{RESULTS}/direct/runs/runs_{{part}}.npz",
    log:
        f"{RESULTS}/logs/simulate_direct_{{part}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/simulate_direct_{{part}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=lambda wildcards, attempt: 30 * attempt,
    params:
        config=CONFIG_FILE,
        number=lambda wildcards: int(wildcards.part),
        folder=f"{RESULTS}/direct/runs",
        physics=content_hash(
            {
                "physics": PHYSICS,
                "simulation": SETTINGS.simulation,
                "geometry": SETTINGS.geometry,
                "coarse": SETTINGS.scales.get("coarse"),  # a configuration may be without it
                "sections": 3,  # raised where `gns.direct.runs.random_slide` draws others
            }
        ),
    message:
        "Simulating part {wildcards.part} of the runs for the direct model"
    shell:
        "python -m flowslide gns direct-runs --parts {params.number}-{params.number} --out {params.folder:q}"
        " --config {params.config:q} --threads {threads} > {log:q} 2>&1"


# A job that is killed leaves the state of the training next to the model, so that the next try goes on.
rule train_direct_network:
    input:
        direct_runs,
    output:
        network=f"{RESULTS}/direct/direct/network_{{network}}.pt",
    log:
        f"{RESULTS}/logs/train_direct_{{network}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/train_direct_{{network}}.tsv"
    threads: 1
    resources:
        mem_mb=10000,
        runtime=lambda wildcards, attempt: 180 * attempt,
    params:
        config=CONFIG_FILE,
        data=f"{RESULTS}/direct/runs",
        folder=lambda wildcards, output: os.path.dirname(output.network),
        networks=DIRECT_NETWORKS,
        physics=content_hash(GNS_PHYSICS),
    message:
        "Learning network {wildcards.network} of the model without steps"
    shell:
        "python -m flowslide gns direct-train --networks {params.networks} --network {wildcards.network}"
        " --data {params.data:q} --out {params.folder:q} --config {params.config:q} --threads {threads}"
        " > {log:q} 2>&1"


rule judge_direct_model:
    input:
        runs=direct_runs,
        networks=[
            f"{RESULTS}/direct/direct/network_{number + 1}.pt" for number in range(DIRECT_NETWORKS)
        ],
    output:
        model=f"{RESULTS}/direct/direct/direct.pt",
        card=f"{RESULTS}/direct/direct/card.yaml",
        table=f"{RESULTS}/direct/direct/training.txt",
    log:
        f"{RESULTS}/logs/judge_direct.log",
    benchmark:
        f"{RESULTS}/benchmarks/judge_direct.tsv"
    threads: 1
    resources:
        mem_mb=10000,
        runtime=lambda wildcards, attempt: 60 * attempt,
    params:
        config=CONFIG_FILE,
        data=f"{RESULTS}/direct/runs",
        folder=lambda wildcards, output: os.path.dirname(output.card),
        networks=DIRECT_NETWORKS,
        physics=content_hash(GNS_PHYSICS),
    message:
        "Calibrating and judging the model without steps"
    shell:
        "python -m flowslide gns direct-train --networks {params.networks} --data {params.data:q} --out {params.folder:q}"
        " --config {params.config:q} --threads {threads} > {output.table:q} 2> {log:q}"
