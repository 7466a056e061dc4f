"""Fluids on the torus as docs/fluids.md and the paper's Example 4 write them: sums over modes."""

import itertools

import numpy as np
from numpy import pi
from uncompiled import program


class Fluid:
    """omega_m' = sum_k c sin(2 pi m x k / N) omega_(m+k) dH/d omega_k, indices modulo N"""

    def __init__(self, N, c, name):
        self.N, self.d, self.model = N, N * N - 1, {"name": name} | ({} if name == "sine_euler" else {"n": N})
        reach = range(-(N // 2), N // 2 + 1)
        self.modes = [m for m in itertools.product(reach, reach) if m != (0, 0)]
        self.rows = {}  # omega_m = row @ y; no page says at which place of the state a mode stands
        for m in self.modes:
            y = program.start(self.model, initial={"modes": {"{},{}".format(*m): "1+2i"}})[0]
            assert sorted(abs(y[y != 0])) == [1, 2]
            self.rows[m] = np.where(abs(y) == 1, y, 0) + 1j * np.sign(np.where(abs(y) == 2, y, 0))
        stored = [m for m in self.modes if self.rows[m].imag.sum() > 0]
        self.stored = sorted(stored, key=lambda m: list(self.rows[m]).index(1))
        self.to_modes = np.array(list(self.rows.values()))
        self.to_state = np.linalg.inv(self.to_modes)
        at = {(m[0] % N, m[1] % N): n for n, m in enumerate(self.modes)} | {(0, 0): self.d}
        pairs = [[(m, k) for k in self.modes] for m in self.modes]
        self.sum = np.array([[at[(m[0] + k[0]) % N, (m[1] + k[1]) % N] for m, k in row] for row in pairs])
        self.sines = c * np.array([[np.sin(2 * pi * (m[0] * k[1] - m[1] * k[0]) / N) for m, k in row] for row in pairs])

    def B(self, y):
        """That of the modes, in the components of the state"""
        omega = np.append(self.to_modes @ y, 0)
        return (self.to_state @ (self.sines * omega[self.sum]) @ self.to_state.T).real

    def energy(self, m):
        """|omega_m|^2 / |m|^2, which is also what m and -m give to H"""
        return lambda y: ((self.rows[m].real @ y) ** 2 + (self.rows[m].imag @ y) ** 2) / np.dot(m, m)

    def noises(self, entries):
        """Hamiltonian and strength of the noises of each entry: one of a mode, or two if linear"""
        for entry in entries:
            shell = [m for m in self.stored if round(np.hypot(*m)) == entry.get("shell")]
            for m in [tuple(m) for m in entry.get("modes", shell)]:
                m = m if m in self.stored else (-m[0], -m[1])  # "expressed by the mode that is in the state"
                if entry.get("hamiltonian") == "linear":
                    for part in self.rows[m].real, self.rows[m].imag:
                        yield (2**0.5 * part / np.hypot(*m)).dot, entry["sigma"]
                else:
                    yield self.energy(m), entry["sigma"]

    def casimir(self, k):
        """tr W^k / N, W = sum omega_m T_m, of N x N matrices with T_m T_k = exp(-2 pi i m x k / N) T_(m+k)"""
        row, turn = np.arange(self.N), 2j * pi / self.N
        waves = [np.exp(turn * (m * n + 2 * n * row)) * np.roll(np.eye(self.N), m, axis=0) for m, n in self.modes]
        power = np.linalg.matrix_power
        return lambda y: np.trace(power(np.tensordot(self.to_modes @ y, waves, 1), k)).real / self.N
