import pytest

from refgi.testing import kit_folder
from refgi.vectors.check import Kit


@pytest.fixture(scope="session")
def kit(monkeypatch_session_cache):
    """The quick kit, made once."""
    return Kit(kit_folder())


@pytest.fixture(scope="session")
def monkeypatch_session_cache():
    """Nothing of the user's own kit is used."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("REFGI_KIT", raising=False)
        yield
