"""Random connected grids for property tests."""

import numpy as np
from hypothesis import strategies as st

from errorscreen.power.elements import Branch, Bus, Generator, Load, Shunt
from errorscreen.power.network import Network
from errorscreen.power.reduction import Reducer


def random_network(seed, n=None, generators=True):
    """Connected grid of moderate loading: a random tree, some more branches, some of them transformers."""
    rng = np.random.default_rng(seed)
    n = n or int(rng.integers(3, 9))
    numbers = rng.permutation(np.arange(1, 100))[:n]
    pairs = [(int(numbers[rng.integers(i)]), int(numbers[i])) for i in range(1, n)]
    pairs += [tuple(int(b) for b in rng.choice(numbers, 2, replace=False)) for _ in range(n // 2)]
    branches = []
    for k, (a, b) in enumerate(pairs):
        transformer = rng.random() < 0.4
        branches.append(
            Branch(
                a,
                b,
                r=rng.uniform(0, 0.02),
                x=rng.uniform(0.02, 0.15),
                b=0.0 if transformer else rng.uniform(0, 0.2),
                tap=rng.uniform(0.93, 1.07) if transformer else 1.0,
                shift=rng.uniform(-0.05, 0.05) if transformer else 0.0,
                circuit=str(k),
            )
        )
    slack, held = int(numbers[0]), int(numbers[1])
    return Network(
        tuple(Bus(int(i)) for i in numbers),
        tuple(branches),
        slack=slack,
        loads=tuple(Load(int(i), rng.uniform(0.0, 0.3), rng.uniform(-0.05, 0.15)) for i in numbers[1:]),
        shunts=(Shunt(int(numbers[-1]), 0.01, 0.05),),
        generators=(
            Generator(slack, v=rng.uniform(0.98, 1.05)),
            Generator(held, p=rng.uniform(0, 0.5), v=rng.uniform(0.98, 1.05)),
        )
        if generators
        else (),
    )


networks = st.integers(0, 2**32 - 1).map(random_network)


def reduce_network(network, terminals, **options):
    """One state of a grid, reduced to terminals."""
    return Reducer(network, terminals, **options).anew(network)


def kron_reduction(Y, keep):
    """Admittance matrix of the kept nodes (F. Dörfler and F. Bullo, IEEE Trans. CAS I, 2013)."""
    k, r = np.array(keep), np.setdiff1d(np.arange(len(Y)), keep)
    return Y[np.ix_(k, k)] - Y[np.ix_(k, r)] @ np.linalg.solve(Y[np.ix_(r, r)], Y[np.ix_(r, k)])
