"""HDF5 in and out: results files, checkpoints and where the numbers came from.

A results file holds one group ``/<case>/<scheme>`` per :class:`~spi.records.Group` and has a dimension scale on every
axis, so that xarray and MATLAB open it as it is.  Files are written aside and moved into place: a reader or a crash
never meets half a file.

How values are kept: strings are UTF-8; arrays of bools are int8 with the attribute ``dtype = "bool"`` (netCDF has no
bool; xarray turns these back); a bool among the attributes is a uint8, which nothing else is; tuples are arrays;
an attribute that is None is left out, and a None inside a tuple of numbers (a noise that is off) becomes nan.
"""

import contextlib
import datetime
import importlib.metadata
import os
import platform
import tempfile
from pathlib import Path

import h5py
import numpy as np

from . import __version__
from .records import Group, Results

#: The root attributes by which our files are known, and the version of their layout.
RESULTS_MARK, CHECKPOINT_MARK, VERSION = "spi_results", "spi_checkpoint", 1

#: From wide to narrow, as the kernel of Linux names them and as we do.
INSTRUCTION_SETS = {"avx512f": "avx512f", "avx2": "avx2", "avx": "avx", "sse2": "sse2", "sve": "sve", "asimd": "neon"}

# HDF5 reports damage in a file by any of these.
_DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError)


class StoreError(Exception):
    """A file that cannot be read, written or used here: one line with the path and the remedy."""


# ---------------------------------------------------------------------------------------------------------------------
# Results
# ---------------------------------------------------------------------------------------------------------------------


def write(path, results):
    """Write ``results`` to ``path``; the folder is made if need be, an older file is replaced whole."""
    with _aside(path) as temporary, _create(temporary) as file:
        file.attrs[RESULTS_MARK] = VERSION
        _write_attributes(file, results.attributes)
        for group in results.groups:
            _write_group(file, group)


def read(path):
    """The :class:`~spi.records.Results` in ``path``; the groups of one case stand together."""
    path = Path(path)
    with _open_results(path) as file:
        try:
            groups = tuple(
                group for case in file for scheme in file[case] for group in _read_groups(case, scheme, file)
            )
            return Results(_read_attributes(file), groups)
        except _DAMAGE as error:
            raise StoreError(f"{path}: the results file is damaged; delete it and run the experiment again") from error


def check_same_spec(path, spec_hash):
    """Refuse to go on with a results file of another spec; a missing file is fine."""
    path = Path(path)
    if not path.exists():
        return
    with _open_results(path) as file:
        if file.attrs.get("spec_hash") != spec_hash:
            raise StoreError(
                f"{path}: holds results of another spec; use --fresh to replace it or --out for another folder"
            )


def check_writable(path):
    """Tell before a long run that ``path`` could not be written at its end; creates its folder."""
    path = Path(path)
    if path.is_dir():
        raise StoreError(f"cannot write {path}: it is a folder; move it away or choose another folder with --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):  # permissions alone do not tell, least of all the superuser
            pass
    except OSError as error:
        folder = error.filename or path.parent
        raise StoreError(
            f"cannot write {path}: {folder}: {_reason(error)}; choose a folder you can write to with --out"
        ) from None


def _write_group(file, group):
    for kind, name in (("case", group.case), ("scheme", group.scheme), ("estimator", group.estimator or "none")):
        if not name or name.startswith(".") or "/" in name:
            raise StoreError(f"the {kind} name {name!r} cannot be stored: choose one without '/' and leading '.'")
    case = file.get(group.case) or file.create_group(group.case, track_order=True)
    target = case.get(group.scheme) or case.create_group(group.scheme, track_order=True)
    if group.estimator:
        target = target.create_group(group.estimator, track_order=True)
    _write_attributes(target, group.attributes)
    for name, values in group.coordinates.items():
        _write_array(target, name, values).make_scale(name)
    for name, (axes, values) in group.variables.items():
        dataset = _write_array(target, name, values)
        if len(axes) != dataset.ndim or not set(axes) <= set(group.coordinates):
            raise ValueError(f"{name}: the axes {axes} do not fit shape {dataset.shape} and {list(group.coordinates)}")
        for i, axis in enumerate(axes):
            dataset.dims[i].attach_scale(target[axis])


def _read_groups(case, scheme, file):
    """The group of a scheme, or those of its estimators."""
    source = file[case][scheme]
    if not isinstance(next(iter(source.values()), None), h5py.Group):
        return [_read_group(case, scheme, "", source)]
    return [_read_group(case, scheme, estimator, source[estimator]) for estimator in source]


def _read_group(case, scheme, estimator, source):
    coordinates, variables = {}, {}
    for name, dataset in source.items():
        if dataset.is_scale:
            coordinates[name] = _read_array(dataset)
        else:
            axes = tuple(Path(dataset.dims[i][0].name).name for i in range(dataset.ndim))
            variables[name] = (axes, _read_array(dataset))
    return Group(case, scheme, coordinates, variables, _read_attributes(source), estimator)


def _write_array(target, name, values):
    values = np.asarray(values)
    if values.dtype.kind == "b":
        dataset = target.create_dataset(name, data=values.astype(np.int8))
        dataset.attrs["dtype"] = "bool"
        return dataset
    if values.dtype.kind == "U":
        return target.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    if values.dtype.kind not in "iuf":
        raise TypeError(f"{name}: arrays of {values.dtype} cannot be stored")
    return target.create_dataset(name, data=values)


def _read_array(dataset):
    if h5py.check_string_dtype(dataset.dtype):
        return np.asarray(dataset.asstr()[()], dtype=str)
    values = np.asarray(dataset[()])
    return values.astype(bool) if dataset.attrs.get("dtype") == "bool" else values


def _write_attributes(target, attributes):
    for name, value in attributes.items():
        if value is not None:
            target.attrs[name] = _encode(name, value)


def _read_attributes(source):
    return {name: _decode(value) for name, value in source.attrs.items() if name != RESULTS_MARK}


def _encode(name, value):
    if isinstance(value, str):
        return value
    values = np.asarray(value)
    if values.dtype.kind == "U":
        return values.astype(h5py.string_dtype())
    if values.dtype == object and all(isinstance(v, int | float | None) for v in values.flat):
        values = values.astype(float)  # None becomes nan
    if values.dtype.kind not in "biuf":
        raise TypeError(f"attribute {name}: {value!r} cannot be stored")
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    return values.astype(np.int64) if values.dtype.kind in "iu" and values.dtype != np.uint64 else values


def _decode(value):
    if isinstance(value, str):
        return value
    values = np.asarray(value)
    return _tuples((values.astype(bool) if values.dtype == np.uint8 else values).tolist())


def _tuples(value):
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


# ---------------------------------------------------------------------------------------------------------------------
# Checkpoints
# ---------------------------------------------------------------------------------------------------------------------


def write_checkpoint(path, spec_hash, state):
    """Keep ``state``, a flat dict of arrays, numbers and strings; a key "a/b" lies in the group "a"."""
    with _aside(path) as temporary, _create(temporary) as file:
        file.attrs[CHECKPOINT_MARK] = VERSION
        file.attrs["spec_hash"] = spec_hash
        for key, value in state.items():
            values = np.asarray(value)
            text = values.dtype.kind == "U"
            file.create_dataset(
                key, data=values.astype(object) if text else values, dtype=h5py.string_dtype() if text else None
            ).attrs["scalar"] = not isinstance(value, np.ndarray)


def read_checkpoint(path, spec_hash):
    """The state kept in ``path``, or None if there is none for this spec that can be read."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs[CHECKPOINT_MARK] != VERSION or file.attrs["spec_hash"] != spec_hash:
                return None
            state = {}

            def collect(key, item):
                if isinstance(item, h5py.Dataset):
                    values = _read_array(item)
                    state[key] = values.item() if item.attrs["scalar"] else values

            file.visititems(collect)
            return state
    except _DAMAGE:
        return None


# ---------------------------------------------------------------------------------------------------------------------
# Provenance
# ---------------------------------------------------------------------------------------------------------------------


def provenance():
    """Root attributes that say when, with what and on which machine results were computed."""
    processor, instruction_set = _processor()
    return {
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "spi_version": __version__,
        "machine_processor": processor,
        "machine_instruction_set": instruction_set,
        "machine_cpu_count": os.cpu_count() or 1,
        "machine_platform": platform.platform(),
        "machine_python": platform.python_version(),
        **{f"machine_{name}": importlib.metadata.version(name) for name in ("numpy", "numba", "h5py")},
    }


def _processor():
    """The name of the processor and its widest vector instructions."""
    facts = {}
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    flags = (facts.get("flags") or facts.get("Features") or "").split()
    name = facts.get("model name") or platform.processor() or platform.machine() or "unknown"
    # Without a list of features (macOS, Windows) 64-bit ARM still means NEON.
    default = "neon" if platform.machine().lower() in ("arm64", "aarch64") else "unknown"
    return name, next((ours for flag, ours in INSTRUCTION_SETS.items() if flag in flags), default)


# ---------------------------------------------------------------------------------------------------------------------
# Files
# ---------------------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def _aside(path):
    """A temporary path beside ``path``, moved into its place if the block ends well and removed if not."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise StoreError(
            f"cannot write {path}: {_reason(error)}; choose a folder you can write to, with room, with --out"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _create(path):
    # Files are replaced whole and never changed, so locks would guard nothing and fail on some network file systems.
    return h5py.File(path, "w", locking=False, track_order=True)


@contextlib.contextmanager
def _open_results(path):
    try:
        file = h5py.File(path, "r", locking=False)
    except FileNotFoundError:
        raise StoreError(f"{path}: no such file; `spi run` writes one") from None
    except OSError as error:
        if path.is_file() and os.access(path, os.R_OK):
            raise StoreError(f"{path}: not a whole HDF5 file; give a results file written by `spi run`") from error
        raise StoreError(f"{path}: {_reason(error)}; give a results file (.h5) that you can read") from error
    with file:
        version = file.attrs.get(RESULTS_MARK)
        if version is None:
            raise StoreError(f"{path}: an HDF5 file, but not of ours; give a results file written by `spi run`")
        if version != VERSION:
            raise StoreError(
                f"{path}: written in layout {version}, this spi reads {VERSION}; use the spi that wrote it"
            )
        yield file


def _reason(error):
    return os.strerror(error.errno).lower() if error.errno else str(error).splitlines()[0]
