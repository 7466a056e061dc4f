"""Expectations without sampling: backward operators of schemes, and the backward equation, on Casimir surfaces."""
