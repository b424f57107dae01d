"""One configuration: defaults, file, overrides, schema; mistakes are one line."""

from __future__ import annotations

import json

import pytest

from pipeline.cli import InputError
from pipeline.config import (
    Config,
    ScaleSettings,
    config_hash,
    load_config,
    parse_override,
    schema_text,
)
from pipeline.files import read_yaml


def test_config_yaml_is_the_defaults_written_out(root):
    assert read_yaml(root / "config" / "config.yaml") == Config().model_dump(mode="json")
    assert load_config(root / "config" / "config.yaml") == load_config(None) == Config()


@pytest.mark.parametrize(
    "name",
    ["config.yaml", "paper.yaml", "slice.yaml", "test.yaml", "thrust.yaml", "thrust_first.yaml"],
)
def test_shipped_configurations_fit_the_schema(root, name):
    import jsonschema

    jsonschema.validate(read_yaml(root / "config" / name), json.loads(schema_text()))
    load_config(root / "config" / name)


def test_every_setting_is_described():
    schema = json.loads(schema_text())
    for group in [schema, *schema["$defs"].values()]:
        for name, field in group["properties"].items():
            assert field.get("description"), name


def test_the_papers_options(root):
    paper = load_config(root / "config" / "paper.yaml")
    assert paper.geometry.materials == "paper"
    assert paper.geometry.water_share == 0
    assert paper.simulation_for("large").time_step_s == 5e-5
    assert paper.simulation_for("small").time_step_s == 1e-5
    assert paper.simulation.initial_stress == "gravity_on"
    assert paper.scale("large").number_of_scenes == paper.scale("small").number_of_scenes == 2500


def test_turns_are_written_where_there_are_some():
    """Keys of what was made before there were any stay as they were."""
    assert "turns" not in Config().scale("coarse").model_dump()
    given = load_config(None, ["scales.coarse.turns=[{first: 3, families: [impoundment]}]"])
    written = given.model_dump(mode="json")
    assert written["scales"]["coarse"]["turns"] == [{"first": 3, "families": ["impoundment"]}]
    assert Config.model_validate(written) == given != Config()


def test_a_file_states_only_what_differs(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("scales:\n  large:\n    number_of_scenes: 7\n")
    config = load_config(path)
    assert config.scale("large").number_of_scenes == 7
    assert config.scale("large").spacing_m == 1.0
    assert config.scale("small") == Config().scale("small")


def test_an_empty_file_is_the_defaults(tmp_path):
    path = tmp_path / "empty.yaml"
    path.write_text("# nothing yet\n")
    assert load_config(path) == Config()


def test_overrides_win_over_the_file(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("simulation: {courant: 0.2, duration_s: 3}\n")
    config = load_config(path, ["simulation.courant=0.25", "geometry.blocks.number=[2, 2]"])
    assert config.simulation.courant == 0.25
    assert config.simulation.duration_s == 3
    assert config.geometry.blocks.number == (2, 2)


def test_a_scale_of_ones_own(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text(
        "scales: {tiny: {number_of_scenes: 3, spacing_m: 4.0, scale_factor: 1, domain_width_m: 240,"
        " domain_height_m: 60, material_ranges: large, duration_s: 2}}"
    )
    assert list(load_config(path).scales) == ["large", "small", "coarse", "tiny"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("simulation.courrant=0.2", "simulation.courrant: no such setting, did you mean courant?"),
        ("scales.large.width=1", "allowed are number_of_scenes, spacing_m"),
        (
            "simulation.courant=2",
            "simulation.courant: 2: input should be less than or equal to 0.9",
        ),
        ("simulation.transfer=magic", "'affine_flip', 'flip', 'apic' or 'pic'"),
        ("simulation.courant=.nan", "every number must be finite"),
        ("simulation=3", "simulation: 3:"),
        ("geometry.template_shares={a: 0, b: 0, c: 0, d: 0, e: 0}", "at least one template"),
        ("gns.train.symmetric=true", "gns.train: symmetric: true needs mirror: true"),
        ("gns.train.grid_everywhere=true", "gns.train: grid_everywhere: true needs a grid_cell"),
        ("geometry.blocks.number=[3, 1]", "the lower limit 3 is above the upper limit 1"),
        ("geometry.blocks.number=[0, 1]", "at least 1 block"),
        ("geometry.blocks.size_m=[0, 1]", "longer than 0"),
        ("geometry.blocks.speed_m_per_s=[-1, 1]", "at least 0"),
        ("scales.coarse.turns=[{families: []}]", "at least 1 item"),
        ("scales.coarse.turns=[{families: [dam]}]", "'template', 'embankment_dam'"),
        (
            "scales.coarse.turns=[{families: [impoundment]}, {families: [template]}]",
            "turns: first must ascend, but is [0, 0]",
        ),
        ("scales.mine.spacing_m=1", "scales.mine.number_of_scenes: is missing (and 5 more)"),
        ("scales.My_scale={}", "string should match pattern"),
        ("courant", "must be KEY=VALUE"),
        ("a..b=1", "must be KEY=VALUE"),
        ("=1", "must be KEY=VALUE"),
    ],
)
def test_a_wrong_setting_is_one_line(override, message):
    with pytest.raises(InputError) as caught:
        load_config(None, [override])
    assert message in str(caught.value)
    assert str(caught.value).startswith("--set") and "\n" not in str(caught.value)


def test_a_wrong_file_is_named_even_when_there_are_overrides(tmp_path):
    path = tmp_path / "my.yaml"
    path.write_text("simulation: {courant: -1}\n")
    with pytest.raises(
        InputError, match="my.yaml: simulation.courant: -1: input should be greater"
    ):
        load_config(path, ["simulation.courant=0.3"])
    path.write_text("- a list\n")
    with pytest.raises(InputError, match="must hold settings"):
        load_config(path)


def test_override_values_are_yaml():
    assert parse_override("a.b=1e-5") == {"a": {"b": 1e-5}}
    assert parse_override("a=null") == {"a": None}
    assert parse_override("a=x=y") == {"a": "x=y"}


def test_the_scale_decides_duration_and_time_step():
    config = load_config(None, ["simulation.time_step_s=1e-4", "scales.small.time_step_s=1e-5"])
    assert config.simulation_for("small").duration_s == 20.0
    assert config.simulation_for("small").time_step_s == 1e-5
    assert config.simulation_for("large").time_step_s == 1e-4
    with pytest.raises(InputError, match="allowed are large, small, coarse"):
        config.simulation_for("huge")


def test_batches_cover_all_scenes_once():
    values = Config().scale("large").model_dump() | {"number_of_scenes": 250}
    scale = ScaleSettings(**values)
    assert scale.number_of_batches == 3
    indices = [index for batch in range(3) for index in scale.batch_indices(batch)]
    assert indices == list(range(250))
    with pytest.raises(InputError, match="allowed are 0 to 2"):
        scale.batch_indices(3)


def test_hash_changes_with_what_is_computed_only():
    assert config_hash(Config()) == config_hash(Config(results_folder="elsewhere"))
    assert config_hash(Config()) != config_hash(load_config(None, ["geometry.seed=1"]))
