"""Notebooks and guide pages of the package: run from an empty folder, and the API reference against the docstrings."""

import base64
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import reference

import subaperture as sar

HERE = Path(__file__).parent
NOTEBOOKS = sorted((HERE.parent / "notebooks").glob("*.ipynb"))
GUIDE = HERE.parents[1] / "guide" / "src" / "python"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    # Figures become outputs of their cells.
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    work = tmp_path / "work"
    work.mkdir()
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(work)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    pictures = [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    said = "".join(output["text"] for output in outputs if output["output_type"] == "stream")
    print(said)
    assert pictures, path
    assert "Warning" not in said, said
    assert list(work.iterdir()) == []
    if path.stem == "inside_rdbp":
        # Of the page: rows of the table, then the former. Kernels of NumPy round differently.
        page = (GUIDE / "notebooks.md").read_text(encoding="utf-8")
        stated = [float(value) for value in re.findall(r"(-\d+\.\d) dB", page)]
        measured = said[said.index("pulses per sub-CPI") :]
        table = [float(value) for row in re.findall(r"^.*[a-z] +(-\d+\.\d) dB +(-\d+\.\d) dB$", measured, re.MULTILINE) for value in row]
        former = [float(re.search(rf"{key}.*measured (-\d+\.\d)", measured)[1]) for key in ("'error_db': -60", "'thesis'")]
        assert table + former == pytest.approx(stated, abs=0.3)
    if folder := os.environ.get("SUBAPERTURE_PICTURES"):
        for number, picture in enumerate(pictures, start=1):
            (Path(folder) / f"{path.stem}-{number}.png").write_bytes(base64.b64decode(picture))


def test_notebooks_have_no_outputs_and_are_listed():
    assert len(NOTEBOOKS) == 5
    page = (GUIDE / "notebooks.md").read_text(encoding="utf-8")
    for path in NOTEBOOKS:
        notebook = json.loads(path.read_text(encoding="utf-8"))
        assert notebook["nbformat"] == 4 and notebook["metadata"]["kernelspec"]["name"] == "python3"
        cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        assert cells and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells), path
        assert any(re.search(r"^ *assert ", "".join(cell["source"]), re.MULTILINE) for cell in cells), path
        assert f"`{path.name}`" in page, path


def blocks(name, language):
    """Blocks of one language on a page of the guide."""
    text = (GUIDE / name).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run_program(text, folder):
    path = folder / "program.py"
    path.write_text(text)
    subprocess.run([sys.executable, path], cwd=folder, check=True)


def test_first_steps_run(tmp_path):
    pytest.importorskip("matplotlib")
    pytest.importorskip("xarray")
    run_program("\n".join(blocks("first-steps.md", "python")), tmp_path)
    image = sar.read_image(tmp_path / "first-image")
    assert image.shape == (360, 360) and (tmp_path / "first-image.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """Folder with recording and plan, as the page makes them, and the image of one process."""
    folder = tmp_path_factory.mktemp("cluster")
    # The command of the package in place of the program.
    program = folder / "bin" / "subap"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m subaperture "$@"\n')
    program.chmod(0o755)
    shell(blocks("cluster.md", "sh")[0], folder, {})
    sar.command("focus", folder / "scene.cphd", "--plan", folder / "plan.json", "--out", folder / "one")
    return folder


def shell(text, folder, variables):
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(["bash", "-eu", "-c", text], cwd=folder, check=True, env={**os.environ, "PATH": path, **variables})


def test_slurm_array_forms_the_image(planned):
    script = next(block for block in blocks("cluster.md", "sh") if "#SBATCH" in block)
    count = int(re.search(r"--array=1-(\d+)", script)[1])
    assert count == 8
    for task in range(1, count + 1):
        shell(script, planned, {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": str(count), "SLURM_CPUS_PER_TASK": "1"})
    assert np.array_equal(sar.read_image(planned / "image").array, sar.read_image(planned / "one").array)


def test_indexed_job_forms_the_image(planned):
    yaml = pytest.importorskip("yaml")
    job = yaml.safe_load(next(block for block in blocks("cluster.md", "text") if "kind: Job" in block))
    spec = job["spec"]
    pod = spec["template"]["spec"]
    container = pod["containers"][0]
    assert spec["completionMode"] == "Indexed" and container["command"] == ["sh", "-c"]
    mount = container["volumeMounts"][0]
    assert mount["name"] == pod["volumes"][0]["name"]
    text = container["args"][0].replace(mount["mountPath"], str(planned)).replace("/image", "/image-of-job")
    for index in range(spec["completions"]):
        shell(text, planned, {"JOB_COMPLETION_INDEX": str(index)})
    assert np.array_equal(sar.read_image(planned / "image-of-job").array, sar.read_image(planned / "one").array)


def test_cluster_programs_run(planned, tmp_path):
    pytest.importorskip("distributed")
    os.symlink(planned / "scene.cphd", tmp_path / "scene.cphd")
    for number, text in enumerate(blocks("cluster.md", "python")):
        folder = tmp_path / str(number)
        folder.mkdir()
        os.symlink(planned / "scene.cphd", folder / "scene.cphd")
        run_program(text, folder)
    assert (tmp_path / "0" / "image" / "image.json").exists()


def test_reference_page_has_the_docstrings():
    undocumented = re.findall(r"^- `\S+: .*`(?: —)?\s*$|^### .*\n\n(?=#)", reference.page(), re.MULTILINE)
    assert not undocumented
    assert reference.page() == (GUIDE / "reference.md").read_text(encoding="utf-8"), "run tests/reference.py to write the page again"


def test_command_returns_json_text_or_none(tmp_path):
    assert 'name = "walk"' in sar.command("simulate", "--example", "walk")
    assert sar.command("simulate", "--preset", "table-2-1", "-o", tmp_path / "a.cphd")["files"]
