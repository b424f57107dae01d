# Random scenes: settings -> scenes -> a gallery to look at.


def scene_physics(wildcards):
    """Everything that decides a scene of a scale, in addition to its number."""
    scale = SETTINGS.scale(wildcards.scale).model_dump()
    for name in ("number_of_scenes", "duration_s", "time_step_s", "runs_per_batch"):
        del scale[name]
    return content_hash(
        {"physics": PHYSICS["geometry"], "geometry": SETTINGS.geometry, "scale": scale}
    )


# Drawn batch by batch, so that a larger number_of_scenes adds batches and leaves the others alone. The
# output is the report of the command, not the folder: scenes that are there already, and still the
# same, are left as they are.
rule sample_scenes:
    output:
        f"{RESULTS}/{{scale}}/scenes/batch_{{batch}}.txt",
    log:
        f"{RESULTS}/logs/sample_{{scale}}_{{batch}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/sample_{{scale}}_{{batch}}.tsv"
    threads: 1
    resources:
        mem_mb=1000,
        runtime=10,
    params:
        config=CONFIG_FILE,
        folder=f"{RESULTS}/{{scale}}/scenes",
        indices=batch_indices,
        physics=scene_physics,
    message:
        "Drawing scenes {params.indices} of the scale {wildcards.scale}"
    shell:
        "python -m flowslide scenes sample --scale {wildcards.scale} --indices {params.indices}"
        " --out {params.folder:q} --config {params.config:q} > {output:q} 2> {log:q}"


rule draw_gallery:
    input:
        scenes,
    output:
        picture=report(
            gallery("{scale}"),
            caption="captions/gallery.rst",
            category="Scenes",
            labels={"scale": "{scale}", "what": "gallery"},
        ),
        draws=f"{RESULTS}/{{scale}}/scenes.txt",
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
        "(cat {input:q} > {output.draws:q} && python -m flowslide show --scale {wildcards.scale}"
        " --out {output.picture:q} --config {params.config:q}) > {log:q} 2>&1"


for scale in SETTINGS.scales:

    rule:
        name:
            f"geometry_{scale}"
        input:
            gallery(scale),
            batch_files(scale, "scenes", "txt"),
        message:
            f"The scenes of the scale {scale} are drawn: {gallery(scale)}"
