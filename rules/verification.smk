# What the solver must reproduce: closed forms, experiments, convergence (docs/records/verification.md).


rule verify:
    output:
        f"{RESULTS}/verification/table.txt",
    log:
        f"{RESULTS}/logs/verification.log",
    benchmark:
        f"{RESULTS}/benchmarks/verification.tsv"
    threads: 2
    resources:
        mem_mb=4000,
        runtime=240,
    params:
        physics=content_hash(PHYSICS),
    message:
        "Running the verification suite; its pictures go to docs/images/verification"
    shell:
        "python -m benchmarks.verification --resume > {log:q} 2>&1 && cp {log:q} {output:q}"
