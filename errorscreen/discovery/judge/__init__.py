"""Tests, rankings, intervals and gains of fitted hypotheses."""
