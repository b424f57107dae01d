# The workflow: random scenes -> simulations -> statistics; case histories -> strengths.
#
#   snakemake simulate_coarse        700 scenes at 2 m spacing: minutes on two cores
#   snakemake simulate_large         2,500 scenes (paper, Table 1); also simulate_small
#   snakemake geometry_large         the scenes alone, with a gallery
#   snakemake pack_coarse            its runs as a learned simulator reads them
#   snakemake train_coarse           a simulator that has learned from them, and what it is worth: hours
#   snakemake train_direct           a learned model without steps: runs of its own, training, card: hours
#   snakemake simulate_lsfd          the Lower San Fernando dam; any folder of case_histories/
#   snakemake invert_lsfd            its strength, found from how far it ran; any folder with a question
#   snakemake posterior_lsfd         everything unknown of it, before and after the measurements; any such folder
#   snakemake joint                  one relation of the strength ratio over several slides (joint.cases)
#   snakemake diagnose_lsfd          which physical effect its model lacks; any folder with a question
#   snakemake hidden_effects         the blind benchmark of the diagnosis: hours, or a cluster
#   snakemake verify                 the verification suite, with its pictures
#   snakemake everything --configfile config/test.yaml       all of it in a few minutes
#   snakemake --report report.html simulate_coarse           a page about what was made
#
# profiles/default is used by itself (all cores of this machine); on a cluster add
# `--workflow-profile profiles/slurm` (docs/how-to/cluster.md). Settings: config/config.yaml.

from snakemake.utils import min_version

min_version("9.10")


configfile: "config/config.yaml"


report: "rules/captions/workflow.rst"


include: "rules/common.smk"
include: "rules/geometry.smk"
include: "rules/simulation.smk"
include: "rules/gns.smk"
include: "rules/direct.smk"
include: "rules/cases.smk"
include: "rules/inversion.smk"
include: "rules/diagnosis.smk"
include: "rules/joint.smk"
include: "rules/hidden_effects.smk"
include: "rules/verification.smk"


rule all:
    default_target: True
    input:
        [rules.simulate_coarse.input, rules.geometry_coarse.input]
        if "coarse" in SETTINGS.scales
        else [],
        rules.simulate_lsfd.input,
    message:
        "The coarse scale and the Lower San Fernando dam are ready under {RESULTS}"


rule train_direct:
    input:
        f"{RESULTS}/direct/direct/card.yaml",
    message:
        "The models without steps are trained and judged: {input}"


rule everything:
    input:
        [gallery(scale) for scale in SETTINGS.scales],
        [statistics(scale) for scale in SETTINGS.scales],
        [batch_files(scale, "trajectories", "h5") for scale in SETTINGS.scales],
        [dataset(scale) for scale in SETTINGS.scales],
        [evaluated(scale) for scale in SETTINGS.scales],
        [simulated_case(case) for case in CASES],
        [inverted_case(case) for case in DRAWN],
        [diagnosed_case(case) for case in DRAWN],
        [posterior_of_case(case) for case in FAMILIES],
    message:
        "All scales and all case histories are ready under {RESULTS}"
