"""
Whitening, wavelet, image size and network width on the 39-bus system
=====================================================================

The influence of four settings of the default screener on the ranking, one at a time, on the case study with its 40
parameters. ``python plot_ieee39_grid_search.py 2500`` takes about half an hour on two cores and 2 GiB. Without a
number, a small search shows the way.
"""

import sys

import numpy as np
from sklearn.dummy import DummyRegressor
from sklearn.model_selection import GridSearchCV, KFold, cross_validate

from errorscreen.cases import load_ieee39
from errorscreen.learning.generation import generate_dataset
from errorscreen.metrics import ndcg_scorer, overlap_scorer
from errorscreen.screening import ContributionScreener, contribution_pipeline

samples = int(sys.argv[1]) if len(sys.argv) > 1 else 36
epochs = 15 if samples >= 1000 else 1

# %%
# Errors of as many wrong models, labelled with the contribution of each parameter. The screener adds the noise of a
# recording to its training errors, 40 dB below the response of each channel to the fault. The scores add the same noise
# to their test errors, so that no setting wins by details that cannot be measured.
system = load_ieee39()
data = generate_dataset(system, samples, random_state=0).valid()
swing = data.baseline - data.baseline[:, :1]
noise = 0.01 * np.sqrt(np.mean(swing**2, axis=1))
print(data)


def measured(scorer):
    """Score on errors with noise."""

    def score(estimator, errors, contributions):
        white = np.random.default_rng(1).standard_normal(errors.shape)
        return scorer(estimator, errors + noise[:, None] * white, contributions)

    return score


# %%
# The default screener and its variations. One fit at a time and no final one: only the images of one fit are in memory.
images, network = "estimator__cwttransformer__", "estimator__cnncontributionregressor__"
rows, columns, wavelet = images + "n_frequencies", images + "n_columns", images + "wavelet"
filters = network + "n_filters"
screener = ContributionScreener(contribution_pipeline(system.event.dt, 0), noise=noise, random_state=0)
screener.set_params(**{network + "max_epochs": epochs, network + "patience": None})
grid = [
    {},
    {"whiten": [False]},
    {wavelet: ["cmor1.0-1.0", "mexh"]},
    {rows: [32], columns: [64]},
    {rows: [64], columns: [256]},
    {filters: [(8, 16, 32), (32, 64, 128)]},
]
scoring = {"overlap": measured(overlap_scorer(10)), "ndcg": measured(ndcg_scorer())}
folds = KFold(3, shuffle=True, random_state=0)
search = GridSearchCV(screener, grid, scoring=scoring, refit=False, cv=folds)
found = search.fit(data.errors, data.contributions).cv_results_
blind = cross_validate(DummyRegressor(), data.errors, data.contributions, scoring=scoring, cv=folds)

# %%
# Mean and standard deviation over the folds, 1 for a perfect order, the best overlap first. The blind ranking takes the
# mean contribution of each parameter and never looks at an error. So few samples as here hardly beat it, if at all.
# They show the way of the search, not the best settings.
lines = [("mean contribution (blind)", "", "", "", *(blind[f"test_{score}"] for score in scoring), "")]
for k, changed in enumerate(found["params"]):
    used = screener.get_params() | changed
    scores = [[found[f"split{fold}_test_{score}"][k] for fold in range(3)] for score in scoring]
    size, seconds = f"{used[rows]} × {used[columns]}", f"{found['mean_fit_time'][k]:.0f} s"
    whitened = "yes" if used["whiten"] else "no"
    lines.append((whitened, used[wavelet], size, ", ".join(map(str, used[filters])), *scores, seconds))
lines.sort(key=lambda line: -np.mean(line[4]))

table = (
    "| whitened | wavelet | image | filters | overlap of the ten largest | NDCG | one fit |\n"
    "|---|---|---|---|---|---|---|\n"
)
for *settings, overlap, ndcg, seconds in lines:
    cells = (*settings, *(f"{np.mean(s):.3f} ± {np.std(s):.3f}" for s in (overlap, ndcg)), seconds)
    table += f"| {' | '.join(cells)} |\n"
print(table)
