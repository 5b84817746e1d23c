import pytest

from refgi.testing import kit_folder
from refgi.vectors.check import Kit


@pytest.fixture(scope="session")
def kit():
    """The quick kit, made once; none of the user's own is used."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("REFGI_KIT", raising=False)
        return Kit(kit_folder())
