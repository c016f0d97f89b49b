"""Progress of a search is logged."""

import logging

import pytest


@pytest.fixture(autouse=True)
def logged(caplog):
    """Lines of a search are in ``caplog.messages``."""
    caplog.set_level(logging.INFO, "errorscreen")
