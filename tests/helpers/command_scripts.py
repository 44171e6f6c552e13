# SPDX-License-Identifier: Apache-2.0
"""Scripts that stand for the official code of papers: they need nothing but Python's standard library."""

import venv
from pathlib import Path

MEAN = """
import ast, json, struct, sys
from array import array
from pathlib import Path

def read(path):
    data = path.read_bytes()
    (length,) = struct.unpack("<H", data[8:10])
    head = ast.literal_eval(data[10:10 + length].decode())
    values = array("f", data[10 + length:])
    assert head["descr"] == "<f4" and not head["fortran_order"]
    return values

def write(path, shape, values):
    head = repr({"descr": "<f4", "fortran_order": False, "shape": shape}).ljust(117) + "\\n"
    path.parent.mkdir(exist_ok=True)
    magic = b"\\x93NUMPY\\x01\\x00" + struct.pack("<H", len(head))
    path.write_bytes(magic + head.encode() + values.tobytes())

capture, out, gain = Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])
index = json.loads((capture / "capture.json").read_text())
photographs = [read(path) for path in sorted((capture / "photographs").glob("*.npy"))]
means = [sum(sum(p[c::3]) for p in photographs) / sum(len(p[c::3]) for p in photographs) for c in range(3)]
colour = [mean * index["exposure"] * gain for mean in means]
for view in index["views"]:
    height, width = view["camera"]["height"], view["camera"]["width"]
    write(out / "albedo" / f"{view['name']}.npy", (height, width, 3), array("f", colour * (height * width)))
print("half way", flush=True)
"""
"""The mean colour of the photographs for the albedo, written as NPY."""

TRIES = """
import json, os, sys
from pathlib import Path
capture, out = Path(sys.argv[1]), Path(sys.argv[2])
done = []
places = {p: p for p in json.load(open("places.json"))}
for name, place in {"its capture": capture, "out": out, **places}.items():
    try:
        os.listdir(place)
        done += [f"listed {name}"] if name != "out" else []
    except OSError:
        pass
    try:
        (Path(place) / "left-behind").write_text("here")
        done.append(f"wrote to {name}")
    except OSError:
        pass
try:
    import graycard
    done.append("imported graycard")
except ImportError:
    pass
text = (capture / "capture.json").read_text()
print(json.dumps({"done": done, "scene": json.loads(text)["scene"], "variables": dict(os.environ)}))
sys.exit(7)
"""
"""It tries to write to places and to list them, and says what it could do."""

WAITS = """
import subprocess, sys, time
children = [subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=new)
            for new in (False, True)]
print("started", flush=True)
open(sys.argv[2] + "/begun", "w").close()
time.sleep(600)
"""
"""It starts children, and waits for nothing."""


def write_script(folder: Path, text: str, name: str = "infer.py") -> Path:
    """Write a script, and return its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return folder


def fresh_python(folder: Path) -> Path:
    """Make a virtual environment that has nothing, and return its interpreter."""
    venv.create(folder, with_pip=False, symlinks=True)
    return folder / "bin" / "python"
