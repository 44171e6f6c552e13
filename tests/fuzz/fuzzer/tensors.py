# SPDX-License-Identifier: Apache-2.0
"""Change safetensors: the header, and tensors by their values, shapes and names; and seal what names them."""

import hashlib
import json
import struct
from pathlib import Path
from random import Random

import numpy as np

from fuzzer.hostile import TEXTS
from fuzzer.plain import attack_bytes
from fuzzer.structure import attack_json, attack_json_text

_DTYPES = {"F32": np.float32, "F64": np.float64, "I64": np.int64, "I32": np.int32, "U8": np.uint8}
_NAMES = ("F16", "BF16", "F32", "F64", "I64", "I32", "U8", "BOOL", "U64", "F8_E4M3", "X")
_VALUES = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e38, -1e38, 1e-45, 1e30, 0.5, 127, 255)


def attack_tensors(rng: Random, path: Path) -> str:
    """Change bytes, the header, or one tensor of a safetensors file."""
    attack = rng.choice((attack_bytes, _header, _tensor, _tensor, _tensor, _tensor))
    try:
        return attack(rng, path)
    except (
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        struct.error,
        RecursionError,
    ):  # changed too much already
        return attack_bytes(rng, path)


def attack_decomposition(rng: Random, folder: Path) -> str:
    """Change a file of a saved decomposition."""
    path = rng.choice(sorted(p for p in folder.iterdir() if p.is_file()))
    return attack_json(rng, path) if path.suffix == ".json" else attack_tensors(rng, path)


def seal_decomposition(folder: Path) -> None:
    """Write the hash of the arrays into the index, as whoever changes them would."""
    index, arrays = folder / "decomposition.json", folder / "arrays.safetensors"
    data = json.loads(index.read_text())
    if "sha256" in data:
        data["sha256"] = hashlib.sha256(arrays.read_bytes()).hexdigest()
        index.write_text(json.dumps(data))


def _parts(path: Path) -> tuple[dict[str, object], dict[str, tuple[str, list[int], bytes]]]:
    data = path.read_bytes()
    (size,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + size])
    metadata, body = header.pop("__metadata__", None), data[8 + size :]
    return metadata, {
        name: (facts["dtype"], facts["shape"], body[slice(*facts["data_offsets"])])
        for name, facts in header.items()
    }


def _save(path: Path, metadata: object, tensors: dict[str, tuple[str, list[int], bytes]]) -> None:
    header: dict[str, object] = {} if metadata is None else {"__metadata__": metadata}
    at = 0
    for name, (dtype, shape, data) in tensors.items():
        header[name] = {"dtype": dtype, "shape": shape, "data_offsets": [at, at + len(data)]}
        at += len(data)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + b"".join(data for _, _, data in tensors.values()))


def _header(rng: Random, path: Path) -> str:
    data = path.read_bytes()
    (size,) = struct.unpack_from("<Q", data)
    text = attack_json_text(rng, data[8 : 8 + size].decode()).encode(errors="replace")
    length = rng.choice((len(text), len(text), len(text), 0, 2**63, 10**8))
    path.write_bytes(struct.pack("<Q", length) + text + data[8 + size :])
    return f"the header of {path.name}"


def _tensor(rng: Random, path: Path) -> str:
    metadata, tensors = _parts(path)
    name = rng.choice(sorted(tensors))
    dtype, shape, data = tensors[name]
    what = rng.choice(
        ("values", "values", "values", "value", "noise", "shape", "rows", "dtype", "cast", "drop", "rename")
    )
    match what:
        case "values" | "value" | "noise" if dtype in _DTYPES:
            data = _other_values(rng, what, np.frombuffer(data, _DTYPES[dtype]).copy()).tobytes()
        case "shape":
            flat = int(np.prod(shape))
            shape = rng.choice(([flat], shape[::-1], [1, *shape], [*shape, 1], [flat, 1], [1, flat]))
        case "rows" if shape and shape[0]:
            row, keep = len(data) // shape[0], rng.choice((0, 1, shape[0] - 1, shape[0] // 2))
            shape, data = [keep, *shape[1:]], data[: keep * row]
        case "dtype":
            dtype = rng.choice(_NAMES)
        case "cast" if dtype in _DTYPES:
            dtype, kind = rng.choice(list(_DTYPES.items()))
            with np.errstate(all="ignore"):
                data = np.frombuffer(data, _DTYPES[tensors[name][0]]).astype(kind).tobytes()
    tensors[name] = dtype, shape, data
    if what == "drop":
        del tensors[name]
    if what == "rename":
        tensors[rng.choice((*TEXTS[:20], rng.choice(sorted(tensors))))] = tensors.pop(name)
    _save(path, metadata, tensors)
    return f"{what} of {name} of {path.name}"


def _other_values(rng: Random, what: str, values: np.ndarray) -> np.ndarray:
    if what == "noise":
        return np.frombuffer(rng.randbytes(values.nbytes), values.dtype)
    chosen = slice(None) if what == "values" else slice(0, max(1, len(values) // 10))
    with np.errstate(all="ignore"):
        values[chosen] = np.array(rng.choice(_VALUES)).astype(values.dtype)
    return values
