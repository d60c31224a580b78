"""Families of problems that are hard in one way each, and what is expected of them.

    python -m benchmarks.stress [--family NAME ...] [--quick] [--limit 3]

Every family is a module of `families`: its cases, and the criteria that their rows must meet.
Results are kept family by family in `docs/stress.json`, from which `docs/stress.md` is written.
"""
