# Random scenes: settings -> scenes -> a gallery to look at.


def scene_physics(wildcards):
    """Everything that decides the scenes of a scale."""
    scale = SETTINGS.scale(wildcards.scale).model_dump()
    for name in ("duration_s", "time_step_s", "runs_per_batch"):
        del scale[name]
    return content_hash(
        {"physics": PHYSICS["geometry"], "geometry": SETTINGS.geometry, "scale": scale}
    )


# The output is the report of the command, not the folder: scenes that are there and still the same are
# left alone, so that a restart goes on where it stopped.
rule sample_scenes:
    output:
        scenes("{scale}"),
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
        folder=f"{RESULTS}/{{scale}}/scenes",
        physics=scene_physics,
    message:
        "Drawing the scenes of the scale {wildcards.scale}"
    shell:
        "python -m geometry sample --scale {wildcards.scale} --out {params.folder}"
        " --config {params.config} > {output} 2> {log}"


rule draw_gallery:
    input:
        scenes("{scale}"),
    output:
        report(
            gallery("{scale}"),
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
    params:
        config=CONFIG_FILE,
    message:
        "Drawing a gallery of the scale {wildcards.scale}"
    shell:
        "python -m geometry show --scale {wildcards.scale} --out {output}"
        " --config {params.config} > {log} 2>&1"


for scale in SETTINGS.scales:

    rule:
        name:
            f"geometry_{scale}"
        input:
            gallery(scale),
            scenes(scale),
        message:
            f"The scenes of the scale {scale} are drawn: {gallery(scale)}"
