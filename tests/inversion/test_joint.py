"""One relation over several slides: what a slide says, posterior, bounds, page, prediction."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy import integrate
from scipy.stats import kstest, norm

import flowslide
from benchmarks.generated_pages import around
from benchmarks.studies import joint_slides
from benchmarks.studies.joint_calibration import SLIDES, catalogue, ranks_of, told
from diagnosis.track_record import mean_worth, worth_of
from flowslide.command_line import main
from inversion.back_analysis.result import Result
from inversion.catalogue.ranges import geometric_mean, load_ranges
from inversion.joint import infer as joint
from inversion.joint.build import document_of
from inversion.joint.document import JointDocument, load_joint
from inversion.joint.evidence import BLOCK, BlowCountOfSlide, SlideEvidence, from_draws, from_result
from inversion.joint.population import (
    RATIOS,
    TAU_STD,
    Hyperparameters,
    PriorGrid,
    log_likelihoods,
    predicted_probability,
)
from inversion.new_case.from_dimensions import case_of_dimensions
from inversion.posterior.document import PosteriorDocument
from inversion.posterior.draws import Draws, save_draws
from inversion.prediction.known_strength import ratio_of_relation, widened
from pipeline.cli import InputError
from pipeline.config import load_config
from pipeline.files import read_json, write_json
from report.charts.joint import _ratio_axis
from report.joint import summary
from report.tables.joint import slide_table
from tests.inversion import report_case
from tests.inversion.slides import FEW, NAMES, dams, slide

# --- what one slide says ---


def test_a_slide_is_as_wide_as_its_verdict_says_and_no_narrower_than_itself():
    narrow, wide = slide("a", 0.1, 0.05), slide("a", 0.1, 0.6)
    factor = 1.0 + worth_of("ambiguous").most_off
    assert narrow.widened(factor).log_std == pytest.approx(math.log(factor) / 1.645)
    assert wide.widened(factor).log_std == 0.6
    assert narrow.widened(factor).formal_std == 0.05
    assert 1.331 < mean_worth() < factor
    assert narrow.weighed(0.25).log_std == pytest.approx(0.1)


def test_the_likelihood_of_a_slide_is_the_integral_over_its_ratio():
    two = replace(slide("a", 0.1, 0.2), centres=np.log([0.08, 0.15]), weights=np.array([0.3, 0.7]))
    mean, std = -2.0, 0.4

    def density(r):
        alone = two.weights @ norm.pdf(two.centres, r, two.std)
        return alone * norm.pdf(r, mean, std)

    expected = integrate.quad(density, -6, 2)[0]
    assert two.likelihood(mean, std) == pytest.approx(expected, rel=1e-6)
    bound = slide("b", 0.4, 0.15, kind="bound", doubt=0.25)
    expected = 0.25 + 0.75 * integrate.quad(
        lambda r: norm.cdf((r - math.log(0.4)) / 0.15) * norm.pdf(r, mean, std), -8, 4
    )[0]  # fmt: skip
    assert bound.likelihood(mean, std) == pytest.approx(expected, rel=1e-6)
    assert slide("c", 0.4, 0.1, kind="undetermined").likelihood(mean, std) == 1.0


def test_quantiles_of_a_slide_alone_are_those_of_its_mixture():
    one = slide("a", 0.1, 0.3)
    expected = 0.1 * np.exp(0.3 * norm.ppf([0.025, 0.5, 0.975]))
    assert one.quantiles((0.025, 0.5, 0.975)) == pytest.approx(expected, rel=1e-4)
    two = replace(one, centres=np.log([0.01, 0.5]), weights=np.array([0.25, 0.75]), std=0.01)
    # The two are far apart: half of the first is an eighth of all, a third of the other a half.
    expected = [0.01, 0.5 * math.exp(0.01 * norm.ppf(1.0 / 3.0))]
    assert two.quantiles((0.125, 0.5)) == pytest.approx(expected, rel=3e-3)


def test_the_likelihood_on_many_cells_is_that_of_single_ones():
    two = replace(slide("a", 0.1, 0.2), centres=np.log([0.08, 0.15]), weights=np.array([0.3, 0.7]))
    means = np.linspace(-4.0, 0.0, 3 * BLOCK // 2).reshape(3, -1)
    found = two.likelihood(means, np.array(0.3))
    alone = [two.likelihood(mean, 0.3) for mean in means[:, -1]]
    assert found.shape == means.shape and found[:, -1] == pytest.approx(alone, rel=1e-12)


def posterior_of(
    after: np.ndarray, prior: np.ndarray, case: str = "a"
) -> tuple[PosteriorDocument, Draws]:
    """A posterior with these draws of ln ratio, (s,)."""
    toe = np.zeros((4000, 1))
    both = (np.exp(after)[:, None], np.exp(prior)[:, None])
    draws = Draws(["ratio"], *both, ["toe"], toe, toe, np.zeros(4000), {}, {})
    spread = {"mean": 0.1, "std": 0.1, "median": 0.135, "interval_50": (0, 1),
              "interval_95": (0, 1)}  # fmt: skip
    unknown = {"name": "ratio", "label": "r", "kind": "parameter", "property": "strength_ratio",
               "zones": ["1"], "unit": "", "prior": "", "before": spread, "after": spread,
               "ratio": spread, "strength_kpa": {**spread, "median": 13.5}, "narrowed": 0.5,
               "sobol": []}  # fmt: skip
    document = PosteriorDocument(
        case=case, title=case.title(), measurement_set="x", spacing_m=1, coarse_spacing_m=None,
        physics={}, settings={}, unknowns=[unknown], numbers=[], other_ways={}, correlation=[[1.0]],
        evidence={"log_evidence": 0, "log_evidence_std": 0, "information_nats": 0},
        runs=dict.fromkeys(("coarse", "refined", "fine", "other_ways", "failed",
                            "simulated_now"), 0),
        remarks=[], timings={}, manifest={},
    )  # fmt: skip
    return document, draws


def said_by(after: np.ndarray, prior: np.ndarray) -> SlideEvidence:
    return from_draws(*posterior_of(after, prior), "posterior.json")


def test_the_prior_of_a_slide_is_divided_out_of_its_draws():
    """A posterior N(-2, 0.3) under a prior N(-1.5, 0.5): the data alone say N(-2.28, 0.375)."""
    random = np.random.default_rng(0)
    prior, after = random.normal(-1.5, 0.5, 4000), random.normal(-2.0, 0.3, 4000)
    found = said_by(after, prior)
    precision = 1 / 0.3**2 - 1 / 0.5**2
    mean = (-2.0 / 0.3**2 + 1.5 / 0.5**2) / precision
    assert found.mean == pytest.approx(mean, abs=0.05)
    assert found.log_std == pytest.approx(precision**-0.5, rel=0.12)
    assert found.sigma_v0_kpa == pytest.approx(100.0)


def test_the_edge_of_a_flat_prior_is_no_evidence():
    """Draws that lean on a bound are weighed evenly there: the ratio is not pushed beyond it."""
    random = np.random.default_rng(0)
    after = -3.0 + np.abs(random.normal(0.0, 0.3, 4000))
    found = said_by(after, random.uniform(-3.0, 0.0, 4000))
    assert found.mean == pytest.approx(after.mean(), abs=0.03)
    assert found.formal_std == pytest.approx(after.std(), rel=0.1)


# --- the relation ---


def test_without_slides_the_prior_comes_back():
    found = PriorGrid().posterior([])
    assert found.log_evidence == pytest.approx(0.0, abs=1e-9)
    assert np.exp(found.quantiles(0, [0.5])[0]) == pytest.approx(math.sqrt(np.prod(RATIOS)))
    assert found.quantiles(1, [0.6827])[0] == pytest.approx(TAU_STD, rel=0.01)


def test_many_good_slides_give_mean_scatter_and_slope():
    random = np.random.default_rng(3)
    counts = random.uniform(3, 16, 40)
    logs = math.log(0.1) + 0.08 * (counts - counts.mean()) + 0.3 * random.standard_normal(40)
    slides = [
        slide(f"s{k}", math.exp(y), 0.05, blow_count=BlowCountOfSlide(n, 0.01, False))
        for k, (y, n) in enumerate(zip(logs, counts, strict=True))
    ]
    found = PriorGrid(slope=True).posterior(slides)
    for axis, truth in enumerate((math.log(0.1), 0.3, 0.08)):
        low, high = found.quantiles(axis, (0.01, 0.99))
        assert low < truth < high and high - low < 0.35
    answer = joint.slope(slides)
    assert answer.told and answer.bayes_factor > 10 and answer.slides == 40
    blind = [replace(one, blow_count=replace(one.blow_count, recalled=True)) for one in slides]
    assert not joint.slope(blind).told and joint.slope(blind).slides == 0


def test_sampler_and_grid_agree():
    settings = load_config(None, ["posterior.live_points=200", "posterior.draws=2000"]).posterior
    found = joint.infer(dams(), settings)
    error = found.sampled.log_evidence - found.grid.log_evidence
    assert abs(error) < 4 * found.sampled.log_evidence_std
    for axis, draws in enumerate((found.mu, found.tau)):
        for share in (0.1, 0.5, 0.9):
            below = found.grid.share_below(axis, float(np.quantile(draws, share)))
            assert below == pytest.approx(share, abs=0.05)
    assert found.ratios.max() <= 1.0


def test_a_bound_by_hand():
    """One relation without scatter that is known: the bound stands with its normal probability."""
    bound = slide("b", 0.4, 0.2, kind="bound")
    relation = Hyperparameters(np.array(math.log(0.13)), np.array(0.1))
    expected = norm.cdf(math.log(0.13 / 0.4) / math.hypot(0.2, 0.1))
    assert np.exp(log_likelihoods([bound], relation))[0] == pytest.approx(expected)


def test_a_bound_that_the_others_contradict_is_doubted_and_one_that_fits_is_not():
    many = [slide(f"s{k}", ratio, 0.1) for k, ratio in enumerate([0.11, 0.12, 0.13, 0.14, 0.12])]
    high, low = slide("high", 0.6, 0.1, kind="bound"), slide("low", 0.05, 0.1, kind="bound")
    ranges = load_ranges()
    (against,) = joint.bounds([*many, high], ranges)
    (fits,) = joint.bounds([*many, low], ranges)
    assert against.probability < 0.01 < 0.95 < fits.probability
    assert against.zone_doubt > 0.98 and fits.zone_doubt == pytest.approx(0.5, abs=0.02)
    assert against.probability == pytest.approx(predicted_probability(high, many), rel=1e-3)
    ways = joint.explanations([*many, high])
    best = max(ways, key=lambda one: one.probability)
    assert "another zone liquefied in High" in best.words and best.probability > 0.9
    assert joint.explanations(many) == []
    # As stated such a bound widens the relation; doubted, it hardly moves it.
    stated, without = joint.readings([*many, high])
    doubted = joint.on_grid("", joint.with_doubt([*many, high]))
    assert stated.scatter.median > 1.5 * without.scatter.median
    assert doubted.median.median == pytest.approx(without.median.median, rel=0.03)


def test_a_slide_left_out_is_missed_where_it_is_another():
    many = [slide(f"s{k}", 0.12, 0.1) for k in range(6)]
    found = {one.case: one for one in joint.left_out([*many, slide("odd", 0.5, 0.1)])}
    assert found["odd"].chance < 0.05 < found["s0"].chance
    low, high = found["odd"].predicted_95
    assert low < 0.12 < high < 0.5


def test_planted_relations_are_found():
    """Ranks of 24 catalogues are uniform; the study has 200."""
    ranks = np.array([ranks_of(number) for number in range(24)])
    for axis in range(3):
        assert kstest(ranks[:, axis], "uniform").pvalue > 0.01
    # The test can fail: an interval half as wide is noticed.
    assert kstest(norm.cdf(3.0 * norm.ppf(ranks[:, 0])), "uniform").pvalue < 0.05


def test_eight_slides_do_not_tell_a_slope_that_is_not_there():
    assert not any(told(number, SLIDES, 0.0) for number in range(4))
    kinds = {one.kind for one in catalogue(np.random.default_rng(0), -1.5, 0.5, 0.0, 40)}
    assert kinds == {"slide", "bound"}


# --- documents, page, command ---


def test_the_secondary_ranges_have_the_mean_and_scatter_that_are_quoted():
    mean, std = geometric_mean(load_ranges())
    assert len(load_ranges()) == 11
    assert mean == pytest.approx(0.095, abs=5e-4) and math.exp(std) == pytest.approx(1.43, abs=5e-3)


@pytest.mark.slow
def test_the_page_has_what_the_slides_at_hand_say():
    """To the noise of the sampler, which is another on each processor."""
    before, after = around(joint_slides.PAGE, "relation")
    page = joint_slides.PAGE.read_text(encoding="utf-8")[len(before) : -len(after)].strip()
    found = joint_slides.relation_table(
        joint_slides.readings(joint_slides.slides_of(read_json(joint_slides.RECORD)))
    )
    words, figures = zip(*(_without_figures(text) for text in (page, found)), strict=True)
    assert words[0] == words[1]
    assert figures[1] == pytest.approx(figures[0], rel=0.1, abs=0.006)


def _without_figures(text):
    """A text without its figures, and these."""
    return re.sub(r"\d[\d.]*", "_", text), [float(one) for one in re.findall(r"\d[\d.]*", text)]


@pytest.fixture(scope="module")
def document() -> JointDocument:
    return document_of(dams(), load_config(None, FEW))


def test_the_page_faces_the_slope_that_stood(document, tmp_path):
    (tmp_path / "joint.json").write_text(document.model_dump_json())
    page = flowslide.write_report(tmp_path).read_text()
    text = summary(document)
    assert (tmp_path / "summary.txt").read_text() == text + "\n"
    assert "another zone liquefied" in page and "Either one relation does not give both" in page
    assert "Whether the ratio rises with N1,60 cannot be told" in text
    assert "secondary, not checked against the book" in text
    assert "its blow count is recalled and unverified; it enters no regression" in text
    assert "no diagnosis is at hand" in text
    assert (tmp_path / "slides.svg").is_file() and (tmp_path / "blow_counts.svg").is_file()
    assert "recalled, unverified" in page and "Olson and Stark (2002)" in page


def test_the_axis_holds_a_slide_that_reaches_far_down(document):
    first = document.slides[0].model_copy(update={"ratio_95": (0.004, 0.3)})
    far = document.model_copy(update={"slides": [first, *document.slides[1:]]})
    axes = [plt.subplots()[1] for _ in range(2)]
    ends = [_ratio_axis(ax, one) for ax, one in zip(axes, (document, far), strict=True)]
    assert ends == [ax.get_xlim()[0] for ax in axes] == [0.02, 0.002]
    plt.close("all")


def test_a_dam_without_a_slide_has_the_ratio_of_the_others(document, tmp_path):
    (tmp_path / "joint.json").write_text(document.model_dump_json())
    found = ratio_of_relation(tmp_path)
    assert found.property == "strength_ratio" and found.zones == ()
    low, high = document.ratio.interval_95
    assert found.at(np.array([-1.96, 0.0, 1.96])) == pytest.approx(
        [low, document.ratio.median, high], rel=0.03
    )
    # This dam's runs may be off as well.
    own, wider = (np.log(one.draws).std() for one in (found, widened(found, 0.3)))
    assert wider == pytest.approx(math.hypot(own, 0.3), rel=0.02)
    assert "(relation of other slides)" in replace(found, zones=("1",)).words


def written(place, case: str, *parameters: dict) -> None:
    """A result.json of a case in a folder of results."""
    found = report_case.document(list(parameters), case=case, title=case)
    size = len(parameters)
    found["answer"]["correlation"]["matrix"] = np.eye(size).tolist()
    write_json(place / case / "inversion" / "result.json", found)


def test_results_become_a_relation(tmp_path, capsys):
    """Two strengths of one slide are one slide; an open one says nothing; a bound is a bound."""
    fit = report_case.parameter
    written(tmp_path, NAMES[0], fit("a", ratio=0.13, ratio_std=0.02))
    written(
        tmp_path, NAMES[1],
        fit("a", ratio=0.1, ratio_std=0.02), fit("b", zones=["2"], ratio=0.2, ratio_std=0.06),
        fit("c", zones=["6"], ratio=0.9, determined=False), report_case.friction(),
    )  # fmt: skip
    stood = {"ratio": 0.45, "ratio_std": 0.06, "ratio_lower_bound_95": 0.36, "lower_bound_95": 20.0}
    written(tmp_path, NAMES[2], fit("a", **stood))
    settings = [f"results_folder={tmp_path}", *FEW]
    main(
        ["joint", *NAMES, "--out", str(tmp_path / "out"), "--weight", f"{NAMES[1]}=0.25",
         *(f"--set={one}" for one in settings), "--quiet"]
    )  # fmt: skip
    found = load_joint(tmp_path / "out")
    one, two, three = found.slides
    assert (one.kind, two.kind, three.kind) == ("slide", "slide", "bound")
    assert two.ratio == pytest.approx(math.sqrt(0.02), abs=1e-4)
    # Of 0.2 and 0.3 the survey has 1.5 / 27.5 each, independently; what else there is is shared.
    survey = 1.5 / 27.5
    shared = 0.5 * sum(math.sqrt(total**2 - survey**2) for total in (0.2, 0.3))
    own = math.hypot(0.5 * math.sqrt(2.0) * survey, shared)
    assert two.formal_log_std == pytest.approx(own, abs=1e-4)
    range_std = math.log(mean_worth()) / 1.645
    assert two.log_std == pytest.approx(2.0 * max(own, range_std), abs=1e-3)
    assert one.factor == pytest.approx(mean_worth(), abs=1e-3) and one.verdict == ""
    assert two.n1_60_recalled and one.n1_60 is None
    assert capsys.readouterr().out == summary(found) + "\n"
    main(["report", str(tmp_path / "out"), "--quiet", "--report", "none"])
    assert capsys.readouterr().out == summary(found) + "\n"


def test_a_slide_from_numbers_enters_by_its_posterior_alone(tmp_path):
    """A back-analysis and a verdict of its median section know nothing of the others."""
    written(tmp_path, NAMES[0], report_case.parameter("a", ratio=0.13, ratio_std=0.02))
    written(tmp_path, "wachusett", report_case.parameter("a", ratio=0.3, ratio_std=0.01))
    cases = [NAMES[0], "wachusett"]
    settings = load_config(None, [f"results_folder={tmp_path}", *FEW])
    with pytest.raises(InputError, match="no answer; `flowslide posterior wachusett` makes one"):
        flowslide.joint(cases, settings=settings)
    random = np.random.default_rng(0)
    after, prior = random.normal(-3.0, 0.8, 4000), random.uniform(-5.0, -1.0, 4000)
    document, draws = posterior_of(after, prior, "wachusett")
    place = tmp_path / "wachusett" / "posterior"
    write_json(place / "posterior.json", document.model_dump(mode="json"))
    save_draws(draws, place / "posterior.nc")
    write_json(tmp_path / "wachusett" / "diagnosis" / "verdict.json", {"verdict": "adequate"})
    found = flowslide.joint(cases, settings=settings)
    drawn, stated = found.slides
    assert (drawn.drawn, stated.drawn) == (True, False)
    assert stated.source.endswith("posterior.json") and stated.verdict == ""
    assert math.log(stated.ratio) == pytest.approx(-3.0, abs=0.1)
    assert stated.factor == pytest.approx(mean_worth(), abs=1e-3)
    # Its own range is wider than that of verdicts, so that nothing is added but the kernels.
    assert stated.log_std == pytest.approx(stated.formal_log_std, rel=0.1)
    assert any(words.startswith("Wachusett: known by a few numbers") for words in found.remarks)
    assert [row[1] for row in slide_table(found).rows] == ["ran", "ran, from numbers"]


def slide_from_numbers(place: Path, name: str, how: str) -> Path:
    """A case of a few numbers, its runout known in some way, with a posterior in the results."""
    place.mkdir(exist_ok=True)
    (place / "stated.yaml").write_text(
        "slid_face: upstream\nheight_m: {value: 20, how: read, source: x}\n"
        f"runout_m: {{value: 30, how: {how}, source: x}}\n"
    )
    case_of_dimensions(str(place / name), str(place / "stated.yaml"))
    random = np.random.default_rng(0)
    found = posterior_of(random.normal(-3.0, 0.8, 4000), random.uniform(-5.0, -1.0, 4000), name)
    write_json(place / name / "posterior" / "posterior.json", found[0].model_dump(mode="json"))
    save_draws(found[1], place / name / "posterior" / "posterior.nc")
    return place / name


def test_recalled_numbers_enter_no_regression(tmp_path):
    """Neither of a file of dimensions nor of measurements that a drawn section was fitted to."""
    written(tmp_path, NAMES[0], report_case.parameter("a", ratio=0.13, ratio_std=0.02))
    settings = load_config(None, [f"results_folder={tmp_path}", *FEW])
    notes = slide_from_numbers(tmp_path, "by_notes", "secondary")
    memory = slide_from_numbers(tmp_path, "by_memory", "recalled")
    found = flowslide.joint([NAMES[0], notes, memory], settings=settings)
    assert [one.kind for one in found.slides] == ["slide", "slide", "recalled"]
    assert found.relation == flowslide.joint([NAMES[0], notes], settings=settings).relation
    assert "By_Memory: rests on recalled numbers (runout_m) and enters no regression" in "".join(
        found.remarks
    )
    assert slide_table(found).rows[2][1:4] == ["recalled, from numbers", None, None]
    with pytest.raises(InputError, match=r"1 of 2 .*recalled numbers: by_memory \(runout_m\)"):
        flowslide.joint([NAMES[0], memory], settings=settings)
    # A drawn section: what its back-analysis was fitted to.
    drawn = tmp_path / "drawn" / NAMES[2]
    shutil.copytree(Path("case_histories") / NAMES[2], drawn)
    survey = drawn / "measurements.yaml"
    survey.write_text(survey.read_text().replace("confidence: published", "confidence: recalled"))
    written(tmp_path, NAMES[2], report_case.parameter("a", ratio=0.13, ratio_std=0.02))
    found = flowslide.joint([NAMES[0], notes, drawn], settings=settings)
    assert found.slides[2].kind == "recalled" and found.relation.slides == 2


def test_a_prior_of_a_fit_would_count_twice(tmp_path):
    found = report_case.document([report_case.parameter("a", has_prior=True)])
    with pytest.raises(InputError, match="a has a prior, which would count twice"):
        from_result(Result.model_validate(found), "result.json")
    nothing = report_case.document([report_case.friction()])
    with pytest.raises(InputError, match="no residual strength with a stress"):
        from_result(Result.model_validate(nothing), "result.json")


def test_what_is_no_catalogue_is_refused(tmp_path):
    config = load_config(None, FEW)
    with pytest.raises(InputError, match="1 of 2 slides says something"):
        document_of([dams()[0], replace(dams()[1], kind="undetermined")], config)
    with pytest.raises(InputError, match="'lower_san_fernando' stands twice"):
        document_of([dams()[0], dams()[0]], config)
    own = f"results_folder={tmp_path}"
    with pytest.raises(InputError, match="lower_san_fernando: holds no answer; `flowslide invert"):
        main(["joint", NAMES[0], NAMES[1], "--set", own])
    with pytest.raises(InputError, match="--weight 'x': must be CASE=W"):
        main(["joint", NAMES[0], NAMES[1], "--weight", "x"])
    for weights, words in (({"x": 0.5}, "is not among the cases"), ({NAMES[0]: 2.0}, "at most 1")):
        with pytest.raises(InputError, match=words):
            flowslide.joint(NAMES[:2], weights=weights)
    with pytest.raises(InputError, match="give strengths, a posterior or a joint relation"):
        flowslide.predict(NAMES[0], ["18+-5"], joint=tmp_path)
    with pytest.raises(InputError, match=r"--distribution: .*--joint has its own"):
        main(["predict", NAMES[0], "--joint", str(tmp_path), "--distribution", "normal"])
