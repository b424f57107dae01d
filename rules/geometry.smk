# Random scenes: settings -> scenes -> a gallery to look at.


def scene_physics(wildcards):
    """Everything that decides the scenes of a scale."""
    scale = SETTINGS.scale(wildcards.scale).model_dump()
    for name in ("duration_s", "time_step_s", "runs_per_batch"):
        del scale[name]
    return content_hash(
        {"physics": PHYSICS["geometry"], "geometry": SETTINGS.geometry, "scale": scale}
    )


rule sample_scenes:
    output:
        directory(f"{RESULTS}/{{scale}}/scenes"),
    log:
        f"{RESULTS}/logs/sample_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/sample_{{scale}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=60,
    params:
        config=CONFIG_FILE,
        physics=scene_physics,
    message:
        "Drawing the scenes of the scale {wildcards.scale}"
    shell:
        "python -m geometry sample --scale {wildcards.scale} --out {output}"
        " --config {params.config} > {log} 2>&1"


rule draw_gallery:
    input:
        f"{RESULTS}/{{scale}}/scenes",
    output:
        report(
            f"{RESULTS}/{{scale}}/gallery.png",
            caption="../report/gallery.rst",
            category="Scenes",
            labels={"scale": "{scale}", "what": "gallery"},
        ),
    log:
        f"{RESULTS}/logs/gallery_{{scale}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/gallery_{{scale}}.tsv"
    threads: 1
    resources:
        mem_mb=2000,
        runtime=20,
    message:
        "Drawing a gallery of the scale {wildcards.scale}"
    shell:
        "python -m geometry show {input} --out {output} > {log} 2>&1"


for scale in SETTINGS.scales:

    rule:
        name:
            f"geometry_{scale}"
        input:
            gallery(scale),
            f"{RESULTS}/{scale}/scenes",
        message:
            f"The scenes of the scale {scale} are drawn: {gallery(scale)}"
