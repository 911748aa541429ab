"""Tests of learning run where its packages are installed."""

import pytest

pytest.importorskip("gymnasium")
