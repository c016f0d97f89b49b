"""
Choosing wavelet, image and network by cross-validation
=======================================================

Images, scaling and network form a scikit-learn pipeline, so `GridSearchCV` chooses their settings. The order of the
parameters counts, not the squared error of the predicted contributions. The package brings scorers for this order.
"""

import numpy as np
import pandas as pd
from sklearn.dummy import DummyRegressor
from sklearn.model_selection import GridSearchCV, KFold, cross_validate
from sklearn.pipeline import make_pipeline

from errorscreen.events import Playback
from errorscreen.features import ChannelScaler, CWTTransformer
from errorscreen.learning.generation import generate_dataset
from errorscreen.learning.regressors import CNNContributionRegressor
from errorscreen.metrics import ndcg_scorer, overlap_scorer
from errorscreen.simulators import PlantSimulator

# %%
# Samples of a photovoltaic plant with 17 parameters, driven with a voltage dip. Each sample is the error of one wrong
# model, labelled with the contribution of each parameter.
time = np.arange(0, 3, 1 / 60)
voltage = np.where((time > 0.5) & (time < 0.65), 0.45, 1.0)
event = Playback(time, "dip", 0.5, {"V": voltage}, initial={"V": 1.0, "P": 0.7, "Q": 0.15})
plant = PlantSimulator("pv_plant", event)
data = generate_dataset(plant, 64, random_state=0).valid()
print(data)

# %%
# Every step can vary: the wavelet, the content of the image, its width, and the network.
pipeline = make_pipeline(
    CWTTransformer(sampling_period=plant.event.dt, n_frequencies=16, n_columns=32),
    ChannelScaler(),
    CNNContributionRegressor((8, 16, 16), 64, max_epochs=4, patience=None, random_state=0),
)
grid = [
    {"cwttransformer__wavelet": ["cmor2.0-1.0", "mexh"]},
    {"cwttransformer__energy": ["linear"]},
    {"cwttransformer__signed": ["linear"], "cnncontributionregressor__lr": [1e-3, 3e-3]},
]
scoring = {"ndcg": ndcg_scorer(), "overlap": overlap_scorer(5)}
folds = KFold(2, shuffle=True, random_state=0)
search = GridSearchCV(pipeline, grid, scoring=scoring, refit="ndcg", cv=folds)
search.fit(data.errors, data.contributions)

# %%
# Mean scores over the folds, 1 for a perfect order, beside those of a ranking that never looks at the error. So few
# samples and epochs show the way of the search, not the best settings.
columns = {"params": "settings", "mean_test_ndcg": "NDCG", "mean_test_overlap": "overlap of the five largest"}
table = pd.DataFrame(search.cv_results_)[list(columns)].rename(columns=columns)
table["settings"] = [
    ", ".join(f"{key.split('__')[1]}={value}" for key, value in row.items()) for row in table["settings"]
]
blind = cross_validate(DummyRegressor(), data.errors, data.contributions, scoring=scoring, cv=folds)
table.loc[len(table)] = ["same order for all errors", blind["test_ndcg"].mean(), blind["test_overlap"].mean()]
print(table.sort_values("NDCG", ascending=False).round(3).to_string(index=False))
