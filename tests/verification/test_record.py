"""What a record of the verification depends on is found by following imports."""

from __future__ import annotations

from benchmarks.verification import record


def test_the_solver_and_all_effects_are_sources_of_every_case():
    for name in record.case_names():
        found = {
            str(path.relative_to(record.ROOT))
            for path in record.sources(record.HERE / f"{name}.py")
        }
        assert f"benchmarks/verification/{name}.py" in found
        if name == "material_paths":  # points alone, without a grid
            continue
        for file in ("tiles", "splines", "transfer", "point_functions", "kernels"):
            assert f"mpm_taichi/solver/{file}.py" in found, (name, file)
        assert "mpm_taichi/materials/mohr_coulomb.py" in found
        assert "mpm_taichi/effects/pore_pressure.py" in found
        assert "geometry/scenes/fill.py" in found
        assert not any(file.startswith(("report/", "pipeline/")) for file in found)


def test_a_change_of_a_source_changes_the_hash(tmp_path, monkeypatch):
    (tmp_path / "benchmarks").mkdir()
    (tmp_path / "geometry").mkdir()
    (tmp_path / "benchmarks" / "case.py").write_text("def run():\n    from geometry import scene\n")
    (tmp_path / "geometry" / "scene.py").write_text("SIZE = 1\n")
    monkeypatch.setattr(record, "ROOT", tmp_path)
    monkeypatch.setattr(record, "HERE", tmp_path / "benchmarks")
    monkeypatch.setattr(record, "EFFECTS", tmp_path / "effects")
    before = record.sources_hash("case")
    assert record.sources_hash("case") == before
    (tmp_path / "geometry" / "scene.py").write_text("SIZE = 2\n")
    assert record.sources_hash("case") != before
