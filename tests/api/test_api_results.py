"""Results as the Python interface shows them, made by hand."""

import html.parser
import sys

import numpy as np
import pytest
import xarray
from filled_results import filled
from scipy.special import stdtrit
from strong_results import H, strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group

import spi
from spi import storage, views
from spi.api.progress import ProgressDisplay
from spi.drawing import Figure
from spi.kinds import KINDS
from spi.running.compiling import Compiling, Job
from spi.statistics import claims
from spi.storage import records
from spi.storage.stored import Swept

EXPECT = [
    claims.Claim("three", "splitting", "order", claims.EQUAL, 0.5, 0.05, "1/2 +- 0.05"),
    claims.Claim("three", "euler_maruyama", "order", claims.AT_LEAST, 1.0, 0.0, "1"),
]


@pytest.fixture
def stored():
    groups = [strong_group(scheme, case) for case in ("three", "one") for scheme in ("euler_maruyama", "splitting")]
    return strong(*groups, expect=claims.as_text(EXPECT), spec="kind: strong\n", title="Strong <errors>")


@pytest.fixture
def results(stored):
    return spi.Results(stored)


def test_indexing_narrows(results):
    assert results.parts == ("three/euler_maruyama", "three/splitting", "one/euler_maruyama", "one/splitting")
    assert list(results) == list(results.parts) and len(results) == 4
    assert results["splitting"].parts == ("three/splitting", "one/splitting")
    assert results["one"].parts == ("one/euler_maruyama", "one/splitting")
    for name in ("one/splitting", "splitting/one"):
        assert results[name].parts == results["one"]["splitting"].parts == ("one/splitting",)
    assert results["one/splitting"]["splitting"].parts == ("one/splitting",)
    assert "splitting" in results and "splitting/one" in results and "spliting" not in results and 0 not in results
    with pytest.raises(KeyError, match="no part spliting; did you mean splitting"):
        results["spliting"]
    with pytest.raises(KeyError, match="no part zzz; parts: three/euler_maruyama, three/splitting"):
        results["zzz"]
    with pytest.raises(KeyError):
        results["one"]["three"]
    with pytest.raises(TypeError, match="indexed by the name of a part, not by 0; parts: three/euler_maruyama, "):
        results[0]


def test_estimators_and_eps_are_words_of_names():
    found = spi.Results(weak(weak_group("splitting", "plain"), weak_group("splitting", "multilevel")))
    assert found.parts == ("main/splitting/plain", "main/splitting/multilevel")
    assert found["plain"].error.dims == ("function", "h")
    found = spi.Results(weak(*(at_eps("ap_splitting", eps) for eps in (1.0, 0.1))))
    assert len(found["multilevel"]) == 2 and len(found[found.parts[1].split("/")[1]]) == 1


def test_a_case_that_is_swept_is_all_of_its_values():
    def at(owner, value):
        return strong_group(
            "splitting", f"{owner}_s={value}", swept=Swept(word="s", value=value, owner=owner, title=owner)
        )

    found = spi.Results(strong(*(at(owner, value) for owner in ("one", "two") for value in (1.0, 2.0))))
    assert found["one"].parts == ("one_s=1.0/splitting", "one_s=2.0/splitting")
    assert found["one/splitting"].parts == found["one"]["splitting"].parts == found["one"].parts
    assert found["one"]["one_s=2.0"].parts == ("one_s=2.0/splitting",) and "one/two_s=1.0" not in found
    assert set(found["two"].table()["case"]) == {"two_s=1.0", "two_s=2.0"}
    with pytest.raises(KeyError, match="no part tow; did you mean two"):
        found["tow"]


def test_arrays_have_coordinates_and_names(results):
    error = results["one/splitting"].error
    np.testing.assert_array_equal(error, H**0.5)
    np.testing.assert_array_equal(error.h, H)
    assert error.dims == ("h",) and error.attrs["long_name"] == "strong error"
    assert error.attrs["formula"].startswith("sup_n (E |y_h")
    assert error.sel(h=2.0**-6).item() == 2.0**-3
    dataset = results["one/splitting"].dataset
    assert dataset.casimir_drift.dims == ("h", "casimir") and dataset.attrs["scheme"] == "splitting"
    assert (dataset.seconds.attrs["units"], dataset.ns_per_step.attrs["units"]) == ("s", "ns")
    assert dataset.error_stderr.attrs["long_name"] == "standard error of the strong error"
    assert "error" in dir(results["one/splitting"]) and "error" not in dir(results)
    with pytest.raises(AttributeError, match="error is of one part; choose one by its name: three/euler_maruyama"):
        _ = results.error
    with pytest.raises(AttributeError, match=r"one/splitting has no eror; arrays: error, error_stderr.* mean error\?$"):
        _ = results["one/splitting"].eror
    for some in (results, results["one/splitting"]):
        with pytest.raises(AttributeError, match=r" has (no )?claim; arrays: .*; did you mean claims\?$"):
            _ = some.claim
    with pytest.raises(AttributeError, match="dataset is of one part"):
        _ = results.dataset


def test_a_tree_has_all_parts(results):
    tree = results.to_xarray()
    assert [node.path for node in tree.leaves] == [f"/{part}" for part in results.parts]
    assert tree["three/splitting"]["error"].identical(results["three/splitting"].error)
    assert tree.attrs["title"] == "Strong <errors>"


def test_components_have_the_names_of_expressions():
    group = trajectory_group("splitting", np.arange(3) / 2, np.arange(6.0).reshape(3, 2), np.ones((3, 1)))
    assert spi.Results(trajectories(group)).y.component.values.tolist() == ["y1", "y2"]
    group.attributes["variables"] = ("prey", "predators")
    found = spi.Results(trajectories(group))
    assert found.y.sel(component="predators").values.tolist() == [1, 3, 5]
    ax = found.plot(Figure().subplots())
    labels = ax.get_legend_handles_labels()[1]
    assert [label.rpartition(", ")[2] for label in labels] == ["prey", "predators"]
    assert ax.get_xlabel() == "time" and ax.get_xscale() == "linear"


def test_orders_and_claims_are_tables(results):
    orders = results.orders
    assert list(orders.columns) == ["case", "scheme", "quantity", "order", "low", "high", "expected"]
    assert orders.scheme.tolist() == ["euler_maruyama", "splitting"] * 2 and set(orders.order) == {0.5}
    assert (orders.low[0], orders.high[0], orders.expected[0]) == (0.48, 0.52, 0.5)
    found = results.claims
    assert found.verdict.tolist() == [claims.CONFIRMED, claims.CONTRADICTED] and found.value.tolist() == [0.5, 0.5]
    assert results["three/splitting"].claims.verdict.tolist() == [claims.CONFIRMED]
    assert len(results["one"].claims) == 0  # of which nothing is claimed
    weak_orders = spi.Results(weak(weak_group("splitting", "plain"))).orders
    assert weak_orders.estimator.tolist() == ["plain"] * 2 and len(set(weak_orders.function)) == 2
    path = trajectory_group("splitting", np.arange(3) / 2, np.ones((3, 2)), np.ones((3, 1)))
    assert len(spi.Results(trajectories(path)).orders) == 0
    table = results["one"].table()
    assert len(table) == 2 * len(H) and table.error[1] == H[1] ** 0.5


def test_results_show_themselves(results, stored, tmp_path):
    assert repr(results).startswith("<spi.Results: Strong <errors> (strong): three/euler_maruyama, three/splitting")
    page = results._repr_html_()
    html.parser.HTMLParser().feed(page)
    assert "Strong &lt;errors&gt;" in page and "<errors>" not in page
    assert "1 confirmed, 1 contradicted" in page and "0.480" in page and "file:" not in page
    storage.write(tmp_path / "s.h5", stored)
    loaded = spi.load(tmp_path / "s.h5")
    assert loaded.path == tmp_path / "s.h5" and "s.h5" in loaded._repr_html_() and "s.h5" in repr(loaded)
    assert loaded.kind == "strong" and loaded.spec == "kind: strong\n"
    assert loaded["one/splitting"].error.equals(results["one/splitting"].error)


def test_curves_in_axes_of_ones_own(results):
    ax = Figure().subplots()
    assert results["one"].plot(ax) is ax
    lines = [container.lines[0] for container in ax.containers]
    assert (
        len(lines) == 2 and len({line.get_color() for line in lines}) == len({line.get_marker() for line in lines}) == 2
    )
    np.testing.assert_array_equal(lines[1].get_xydata(), np.column_stack([H, H**0.5]))
    (segments,) = ax.containers[0].lines[2]
    low, high = segments.get_segments()[0][:, 1]
    assert high - low == pytest.approx(2 * stdtrit(63, 0.975) * 0.02 * H[0] ** 0.5)
    assert (ax.get_xscale(), ax.get_yscale(), ax.get_xlabel()) == ("log", "log", "step size")
    assert ax.get_ylabel() == "strong error"
    ax = Figure().subplots()
    ax.set_ylabel("mine")
    results["one/splitting"].plot(ax, "ns_per_step", color="k", label="speed")
    assert ax.get_ylabel() == "mine" and ax.get_legend_handles_labels()[1] == ["speed"]
    assert ax.containers[0].lines[0].get_color() == "k"
    with pytest.raises(ValueError, match="one/splitting has no speed against h or t; give quantity= one of error, "):
        results["one/splitting"].plot(ax, "speed")
    assert results.plot(width="12cm", height=4, font_size=7).get_size_inches().tolist() == pytest.approx([12 / 2.54, 4])
    with pytest.raises(ValueError, match="quantity, color: only for curves in given axes"):
        results.plot(quantity="error", color="k")
    weak_ax = spi.Results(weak(weak_group("splitting", "plain"))).plot(Figure().subplots())
    assert len(weak_ax.containers) == 2 and all((line.lines[0].get_ydata() >= 0).all() for line in weak_ax.containers)


def test_a_figure_shows_itself_in_a_notebook(results):
    figure = results["three/splitting"].plot()
    assert isinstance(figure, Figure) and figure._repr_png_().startswith(b"\x89PNG")
    assert len(figure.axes) == 1 and len(results.plot().axes) == 2


class ZMQInteractiveShell:
    """What a kernel of Jupyter has."""


@pytest.mark.parametrize(("wanted", "shown"), [(None, True), (True, True), (False, False)])
def test_a_notebook_shows_a_line(monkeypatch, capsys, wanted, shown):
    shows = []

    class Display:
        """What IPython.display has, and the handle of what it displays."""

        @staticmethod
        def display(what, *, raw, display_id):
            shows.append([what["text/plain"]])
            return Display

        @staticmethod
        def update(what, *, raw):
            shows[-1].append(what["text/plain"])

    class Notebook:
        get_ipython, display = staticmethod(ZMQInteractiveShell), Display

    monkeypatch.setitem(sys.modules, "IPython", Notebook)
    with ProgressDisplay("mine", wanted) as line:
        for done in (1, 2, 3):
            line.share("paths", done, 4)
        line.watch.tell("news")
        line.watch.report_compiling(Compiling(1, (Job("splitting", "", "integrate", (), 7.0),), 1))
    out, err = capsys.readouterr()
    assert (out, err) == ("news\n" if shown else "", "")  # and no carriage return
    compiling = "mine: compiling splitting, 1 of 1 kernel, about 9 s: splitting (7 s)"
    one = ["mine: paths 25%", "mine: paths 50%", "mine: paths 75%", compiling, ""]
    assert shows == ([one] if shown else [])


def test_without_a_notebook_there_is_no_line(capsys):
    with ProgressDisplay("mine", None) as line:
        line.share("paths", 1, 4)
    assert capsys.readouterr() == ("", "")


def is_short(value):
    """Whether these are whole numbers of 32 bits."""
    return all(isinstance(x, int) and not isinstance(x, bool) and abs(x) < 2**31 for x in np.ravel(value).tolist())


@pytest.mark.parametrize("kind", KINDS)
def test_results_of_every_kind_are_written_as_netcdf(kind, tmp_path):
    """netCDF has no booleans; xarray reads arrays of them back, and attributes as 1 and 0.

    Its version 3, which scipy writes, has no lists of texts and no whole numbers of 64 bits.
    """
    group = filled(kind)
    made = {"truncate_noise": True, "flags": (True, False), "nothing": None, "words": ("one", "two, or three")}
    group.attributes.update(made | {"none": (), "variables": tuple("abcd"), "large": 2**40, "larger": 2**60 + 1})
    results = spi.Results(records.StoredResults({"kind": kind, "title": "A title", "complete": True}, (group,)))
    (reading,) = views.readings(results.stored)
    for name, (_, values) in reading.exported().items():  # with the ends of intervals
        if name not in group.attributes:
            assert np.array_equal(results.dataset[name], values, equal_nan=values.dtype.kind == "f")
    for name, table in results.tables.items():
        assert len(table) and results.table(name).equals(table)
    results.dataset.to_netcdf(tmp_path / "one.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "one.nc", engine="h5netcdf") as again:
        assert again.attrs["truncate_noise"] == 1 and again.attrs["flags"].tolist() == [1, 0]
        assert set(again.variables) == set(results.dataset.variables) and "nothing" not in again.attrs
        for name, values in results.dataset.data_vars.items():
            assert again[name].dtype.kind == values.dtype.kind or values.dtype.kind in "UO"
            assert np.array_equal(again[name], values, equal_nan=values.dtype.kind == "f")
    tree = results.to_xarray()
    for dataset in (results.dataset, *(node.dataset for node in tree.subtree)):
        for attributes in (dataset.attrs, *(values.attrs for values in dataset.variables.values())):
            for name, value in attributes.items():
                assert isinstance(value, str) or np.asarray(value).dtype.kind == "f" or is_short(value), name
    results.dataset.to_netcdf(tmp_path / "three.nc", engine="scipy")
    with xarray.open_dataset(tmp_path / "three.nc", engine="scipy") as again:
        assert set(again.variables) == set(results.dataset.variables)
        assert again.attrs["words"].splitlines() == ["one", "two, or three"] and again.attrs["none"] == ""
        assert again.attrs["large"] == 2**40 and int(again.attrs["larger"]) == 2**60 + 1
        assert again.attrs["variables_"] == "a\nb\nc\nd"
    tree.to_netcdf(tmp_path / "all.nc", engine="h5netcdf")
    with xarray.open_datatree(tmp_path / "all.nc", engine="h5netcdf") as tree:
        assert tree.attrs["complete"] == 1 and [node.path for node in tree.leaves] == ["/main/splitting"]
