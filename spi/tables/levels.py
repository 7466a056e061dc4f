"""Tables of the levels of multilevel estimates (Giles, Operations Research 56, 2008)."""

import math

from .text import INTERVAL, new_table, power_of_two, short, with_interval

KURTOSIS = 100.0  #: beyond that few samples carry the variance, whose estimate is then poor
CONSISTENCY = 1.0  #: beyond that means of neighbouring levels disagree, but for 0.3 % of the time


def level_table(group, f, title):
    """The levels of one test function, from large to small steps."""
    from rich.text import Text

    v = group.arrays
    lost = bool("level_nonfinite" in v and v["level_nonfinite"].any())
    headings = ["steps", "mean of the\ndifference (95 %)", "variance", "kurtosis", "consis-\ntency"]
    headings += ["samples", "µs per\nsample", *["non-\nfinite"] * lost]
    table = new_table(f"{title}: levels", headings, left=1)
    coarse = group.coordinates["level"]
    for i in coarse.argsort()[::-1]:
        variance, kurtosis, consistency = (
            float(v[f"level_{name}"][f, i]) for name in ("variance", "kurtosis", "consistency")
        )
        samples = int(v["level_samples"][i])
        half = INTERVAL * math.sqrt(variance / samples) if variance > 0 and samples else 0.0
        table.add_row(
            f"{power_of_two(coarse[i])}, {power_of_two(coarse[i] / 2)}",
            with_interval(float(v["level_mean"][f, i]), half),
            short(variance, ".2e"),
            Text(f"{kurtosis:.3g}", style="bold red" if kurtosis > KURTOSIS else ""),
            Text(f"{consistency:.2f}", style="bold red" if consistency > CONSISTENCY else ""),
            short(float(samples), ".2e") if samples >= 1e6 else str(samples),
            f"{1e6 * v['level_seconds'][i]:.3g}",
            *[Text(str(v["level_nonfinite"][i]), style="bold red" if v["level_nonfinite"][i] else "")] * lost,
        )
    return table


def level_warnings(group, f):
    """The rates by which mean, variance and cost of the levels change, and what speaks against them."""
    v, a = group.arrays, group.attributes
    rates = {"mean": "level_mean_rate", "variance": "level_variance_rate"}
    told = [f"{what} {_rate(v, name, f)}" for what, name in rates.items() if name in v]
    if math.isfinite(a.get("level_cost_rate", math.nan)):
        told.append(f"cost h^-{a['level_cost_rate']:.2f}")
    twins = "; with reversed twins" if a.get("twins") else ""
    if told:
        yield f"levels: {', '.join(told)}{twins}"
    for h, kurtosis, consistency in zip(
        *(group.coordinates["level"], v["level_kurtosis"][f], v["level_consistency"][f]), strict=True
    ):
        if kurtosis > KURTOSIS:
            yield f"kurtosis {kurtosis:.3g} at {power_of_two(h)}: the variance estimate is poor"
        if consistency > CONSISTENCY:
            yield f"consistency {consistency:.2f} at {power_of_two(h)}: the means of neighbouring levels disagree"


def _rate(v, name, f):
    rate, low, high = (float(v[f"{name}{end}"][f]) for end in ("", "_low", "_high"))
    return f"h^{rate:.2f} [{low:.2f}, {high:.2f}]" if math.isfinite(rate) else "not resolved"
