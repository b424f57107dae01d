"""What a record of the verification depends on is found by following imports."""

from __future__ import annotations

from benchmarks.verification import sources
from benchmarks.verification.study import Verification


def test_the_solver_and_all_effects_are_sources_of_every_case():
    study = Verification()
    for name in study.names():
        files = sources.sources(study.folder / f"{name}.py")
        found = {str(path.relative_to(sources.ROOT)) for path in files}
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
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    monkeypatch.setattr(sources, "EFFECTS", tmp_path / "effects")
    program = tmp_path / "benchmarks" / "case.py"
    before = sources.sources_hash(program)
    assert sources.sources_hash(program) == before
    (tmp_path / "geometry" / "scene.py").write_text("SIZE = 2\n")
    assert sources.sources_hash(program) != before
