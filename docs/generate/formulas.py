"""The formulas of the schemes in LaTeX, for the reference; ``spi/schemes/table.py`` has them as plain text."""

_DRIFT = r"\exp(h Y_{H_p}) \cdots \exp(h Y_{H_1})"
_NOISE = r"\exp(\sigma_m \mathrm{d}W_m Y_{\widehat H_m}) \cdots \exp(\sigma_1 \mathrm{d}W_1 Y_{\widehat H_1})"
_CAYLEY = r"h \nabla H + \sum_k \sigma_k\, \mathrm{d}W_k \nabla \widehat H_k"
_ITO = r"\tfrac12 \sum_k \sigma_k^2"
_JOINT = r"J_k = \exp\!\left(\tfrac{h}{2} Y_{H_k} + \tfrac12 \sigma_k\, \mathrm{d}W_k Y_{\widehat H_k}\right)"
_IMPLICIT = r"\xi^n = \xi^{n-1} - \frac{h}{\varepsilon^2} \xi^n + \frac{\mathrm{d}W}{\varepsilon}"

#: By the names of the schemes; lines are separated by two backslashes.
FORMULAS = {
    "splitting": rf"z = {_DRIFT}\; {_NOISE}\, y",
    "splitting_drift_first": rf"z = {_NOISE}\; {_DRIFT}\, y",
    "splitting_areas": rf"z = {_DRIFT}\, L\, {_NOISE}\, y, \\ L = \prod_{{k < l}} \exp(-b Y_l) "
    r"\exp(-a Y_k) \exp(b Y_l) \exp(a Y_k), \qquad a b = -\sigma_k \sigma_l J_{lk}",
    "splitting_joint_lie": r"z = J_p \cdots J_1\, y, \qquad "
    r"J_k = \exp(h Y_{H_k} + \sigma_k\, \mathrm{d}W_k Y_{\widehat H_k})",
    "splitting_joint": rf"z = J_1 \cdots J_p\; J_p \cdots J_1\, y, \qquad {_JOINT}",
    "splitting_joint_areas": rf"z = J_1 \cdots J_p\; L\; J_p \cdots J_1\, y, \qquad {_JOINT}, \\ "
    r"L = \prod_{k < l} \exp(\sigma_k \sigma_l A_{kl} Y_G), \qquad G = \{\widehat H_l, \widehat H_k\}, \quad "
    r"\text{or loops in place of these flows}",
    "splitting_order2": r"z = S(h/2)\, N\, S(h/2)\, y, \\ S \text{ the symmetric composition of the drift flows, } "
    r"N \text{ the noise flows in random order}",
    "splitting_symmetric": r"z = D^* N D\, y, \\ D \text{ the drift flows over } h/2, \quad D^* = D \text{ reversed}, "
    r"\quad N \text{ the symmetric composition of the noise flows}",
    "euler_maruyama": rf"z = y + h \left( f(y) + {_ITO} f'_k(y) f_k(y) \right) "
    r"+ \sum_k \sigma_k\, \mathrm{d}W_k\, f_k(y)",
    "euler_maruyama_renormalised": r"\frac{|y|}{|z|}\, z \quad \text{with the } z \text{ of Euler-Maruyama}",
    "midpoint": r"z = y + h f\!\left(\frac{y+z}{2}\right) + \sum_k \sigma_k\, \mathrm{d}W_k\, "
    r"f_k\!\left(\frac{y+z}{2}\right)",
    "munthe_kaas_euler": rf"z = \exp(M(v))\, y, \qquad v = h \left( \nabla H + {_ITO} \nabla^2 \widehat H_k "
    r"f_k \right) + \sum_k \sigma_k\, \mathrm{d}W_k \nabla \widehat H_k \quad \text{at } y",
    "munthe_kaas_midpoint": r"z = \exp(M(v(x)))\, y, \qquad x = \exp(M(v(y)) / 2)\, y, \qquad "
    rf"v = {_CAYLEY}",
    "munthe_kaas_areas": r"z = \exp(M(v(x)))\, y, \qquad x = (1 + \tfrac12 M + \tfrac18 M^2)\, y, \quad "
    r"M = M(v(y)), \\ "
    rf"v = {_CAYLEY} + \sum_{{k < l}} \sigma_k \sigma_l A_{{kl}} \nabla \{{\widehat H_l, \widehat H_k\}}",
    "isospectral_midpoint": r"y = u - \tfrac12 u \times v + \tfrac14 (v \cdot u)\, v, \qquad "
    rf"z = u + \tfrac12 u \times v + \tfrac14 (v \cdot u)\, v, \\ v = {_CAYLEY} \quad \text{{at }} u",
    "roessler_rs2": r"z = y + \tfrac{h}{4} \left( f(y) + f(u) + 2 f(v) \right) + \tfrac18 \sum_k \sigma_k\, "
    r"\mathrm{d}W_k \left( f_k(y) + 3 f_k(y_k) + 3 f_k(v_k) + f_k(w_k) \right) \\ "
    r"\qquad - \tfrac14 \sum_k \sigma_k \sqrt{h} \left( f_k(y + G_k) - f_k(y - G_k) \right)",
    "ap_splitting": r"\text{splitting with } \frac{h}{\varepsilon} \xi_k^n \text{ for } \mathrm{d}W_k, \qquad "
    + _IMPLICIT,
    "ap_splitting_midpoint": r"\text{splitting with } \frac{h}{2 \varepsilon} \left( \xi_k^{n-1} + \xi_k^n \right) "
    r"\text{ for } \mathrm{d}W_k, \qquad \xi^n \text{ by the midpoint rule}",
    "multiscale_euler": r"z = y + h f(y) + \sum_k \sigma_k f_k(y) \frac{h}{\varepsilon} \xi_k^{n-1}, \qquad "
    r"\xi^n = \xi^{n-1} - \frac{h}{\varepsilon^2} \xi^{n-1} + \frac{\mathrm{d}W}{\varepsilon}",
    "multiscale_euler_semi_implicit": r"z = y + h f(y) + \sum_k \sigma_k f_k(y) \frac{h}{\varepsilon} \xi_k^n, \qquad "
    + _IMPLICIT,
}
