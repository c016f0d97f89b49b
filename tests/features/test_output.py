"""Names of columns and data frames as output: of tables, while stacks of signals and images stay arrays."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.utils import estimator_checks

from errorscreen.features import ChannelScaler, CWTTransformer, ErrorWhitener, ResponseErrorTransformer

FLAT = CWTTransformer(output="flat", n_frequencies=2, n_columns=3, f_min=0.1, f_max=0.2, signed="linear")
TABLES = [ResponseErrorTransformer(), ChannelScaler(), ErrorWhitener(), FLAT]
STACK = np.random.default_rng(0).normal(size=(5, 2, 8))


def name(value):
    return getattr(value, "__name__", type(value).__name__)


@pytest.mark.parametrize(
    "check",
    [
        estimator_checks.check_set_output_transform,
        estimator_checks.check_set_output_transform_pandas,
        estimator_checks.check_global_output_transform_pandas,
        estimator_checks.check_transformer_get_feature_names_out,
    ],
    ids=name,
)
@pytest.mark.parametrize("transformer", TABLES, ids=name)
@pytest.mark.filterwarnings("ignore:X .*feature names")
def test_tables_become_data_frames(transformer, check):
    check(type(transformer).__name__, transformer)


@pytest.mark.parametrize("transformer", TABLES[:3], ids=name)
def test_columns_keep_their_names(transformer):
    table = pd.DataFrame(STACK[:, 0], columns=[f"P[{t / 20:g} s]" for t in range(8)])
    result = transformer.set_output(transform="pandas").fit_transform(table)
    assert result.columns.tolist() == transformer.get_feature_names_out().tolist() == list(table.columns)


def test_columns_of_images_are_named_by_channel_part_frequency_and_time():
    names = FLAT.fit(STACK).get_feature_names_out(["P", "Q"])
    assert len(set(names)) == len(names) == FLAT.transform(STACK).shape[1]
    assert names[[0, 1, 3, 6, 12, -1]].tolist() == [
        "P:0.1Hz:0", "P:0.1Hz:1", "P:0.2Hz:0", "Q:0.1Hz:0", "P.re:0.1Hz:0", "Q.im:0.2Hz:2",
    ]  # fmt: skip
    two_rows = CWTTransformer(output="flat", n_channels=2).fit(STACK.reshape(5, -1))
    assert two_rows.get_feature_names_out()[-1].startswith("x1:")


@pytest.mark.parametrize("transformer", [*TABLES[:3], CWTTransformer()], ids=name)
def test_stacks_stay_arrays_without_names(transformer):
    transformer.set_output(transform="pandas").fit(STACK)
    assert isinstance(transformer.transform(STACK), np.ndarray)
    with pytest.raises(AttributeError):
        transformer.get_feature_names_out()


def test_a_pipeline_from_signals_to_a_table_can_be_set_as_a_whole():
    pipeline = make_pipeline(ErrorWhitener(), ChannelScaler(), FLAT)
    frame = pipeline.set_output(transform="pandas").fit_transform(STACK)
    assert frame.columns[0] == "x0:0.1Hz:0"
    assert pipeline.set_output(transform="default").transform(STACK).shape == frame.shape
