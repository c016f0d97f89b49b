"""Stacks of signals and images take one shape, and noise that of the signals."""

import numpy as np

from errorscreen.features.checks import as_images, check_noise, split_channels


def test_signals_and_tables_are_images_of_one_row():
    assert as_images(np.zeros((5, 2, 7))).shape == (5, 2, 1, 7)
    assert as_images(np.zeros((5, 7))).shape == (5, 1, 1, 7)


def test_a_row_holds_the_channels_one_after_another():
    assert split_channels(np.zeros((5, 12)), 3, "X").shape == (5, 3, 4)


def test_noise_of_channels_holds_at_all_instants():
    assert check_noise([2.0, 0.0], (2, 3), "here").tolist() == [[2.0] * 3, [0.0] * 3]
