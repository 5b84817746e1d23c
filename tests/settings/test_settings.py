"""Property tests of composed settings: keys, choices, checks and text."""

import dataclasses
from typing import ClassVar, Literal

import pytest

from refgi.cluster.settings import Clusters
from refgi.errors import InputError
from refgi.settings import Settings, changed, flat, from_text, leaves, of, replaced, schema, setting
from refgi.splat import MultiresSettings


@dataclasses.dataclass(frozen=True)
class Warp(Settings):
    levels: int = setting(3, "levels", least=0, most=32)
    share: float = setting(0.0, "evenly spread share", least=0.0, most=1.0)


@dataclasses.dataclass(frozen=True)
class LightSettings(Settings):
    PRINCIPAL = "count"

    count: int = setting(768, "pixel lights", least=1, most=1 << 24)
    pattern: Literal["grid", "halton"] = setting("halton", "where they lie")
    warp: Warp | None = setting(None, "importance")


@dataclasses.dataclass(frozen=True)
class Csm(Settings):
    SWITCHES = frozenset({"alpha"})

    terms: int = setting(4, "terms", least=1, most=64)
    as_published: frozenset[str] = setting(frozenset(), "printed forms", study=True)
    bias: float | None = setting(None, "bias", least=0.0, most=0.25)


@dataclasses.dataclass(frozen=True)
class BackProjection(Settings):
    pass


@dataclasses.dataclass(frozen=True)
class Pcf(Settings):
    PRINCIPAL = "texels"

    texels: int = setting(5, "width", least=1, most=31)


@dataclasses.dataclass(frozen=True)
class MethodSettings(Settings):
    lights: LightSettings = setting(LightSettings(), "lights")
    shadow: Csm | Pcf | BackProjection | None = setting(Csm(), "shadow")
    blur: bool = setting(True, "blur")
    as_published: frozenset[str] = setting(frozenset(), "printed forms", study=True)
    SWITCHES: ClassVar[frozenset[str]] = frozenset({"no_pi", "tan"})

    def check(self) -> None:
        if self.lights.count == 13:
            raise InputError("lights.count: expected another number, got 13", key="lights.count")


def test_defaults_are_kept():
    assert of(MethodSettings) == MethodSettings()
    assert changed(MethodSettings()) == {}


@pytest.mark.parametrize("key", ["lights.count", "lights_count", "count", "lights"])
def test_short_keys_mean_the_same(key):
    assert of(MethodSettings, **{key: 5}).lights.count == 5


@pytest.mark.parametrize("value", ["pcf", Pcf()])
def test_a_choice_is_made_by_name_or_instance(value):
    assert of(MethodSettings, shadow=value) == MethodSettings(shadow=Pcf())


def test_a_choice_stands_for_its_principal_setting():
    pcf = MethodSettings(shadow=Pcf())
    assert replaced(pcf, {"shadow": 9}).shadow == from_text(pcf, ["shadow=9"]).shadow == Pcf(9)
    assert from_text(pcf, ["shadow=none"]).shadow is None
    with pytest.raises(InputError, match="shadow: expected none or csm"):  # has none
        from_text(MethodSettings(), ["shadow=9"])


def test_a_part_of_a_choice_stands_for_its_principal_setting():
    """Property: as it does outside of a choice, also where that choice is only now made."""
    for settings in (MultiresSettings(), of(MultiresSettings, visibility="val")):
        shadows = replaced(settings, {"visibility": "val", "clusters": 7, "visibility.maps": 64}).subsplats.visibility
        assert (shadows.clusters, shadows.maps.resolution) == (Clusters(count=7), 64)


def test_settings_of_a_choice_go_with_it():
    assert of(MethodSettings, shadow="pcf", texels=7).shadow == Pcf(7)
    assert of(MethodSettings, shadow_terms=7).shadow == Csm(7)
    assert of(MethodSettings, warp_levels=5).lights.warp == Warp(5)
    assert of(MethodSettings, shadow="back_projection").shadow == BackProjection()
    assert of(MethodSettings, shadow=None).shadow is None
    assert of(MethodSettings, shadow="none").shadow is None


@pytest.mark.parametrize(("values", "message"), [
    ({"shadow": "pcf", "terms": 3}, "shadow.terms: not a setting of shadow=pcf"),
    ({"shadow": None, "terms": 3, "texels": 3}, "shadow.terms: not a setting of shadow=none"),
    ({"texels": 3}, "shadow.texels: not a setting of shadow=csm"),
    ({"shadow": "esm"}, "shadow: expected none or csm or pcf or back_projection, got 'esm'"),
    ({"light": 3}, "'light' is not a setting of MethodSettings"),
    ({"lights": 0}, "lights.count: expected a whole number, 1 to 16,777,216, got 0"),
    ({"lights": 1.5}, "lights.count: expected a whole number"),
    ({"lights": True}, "lights.count: expected a whole number"),
    ({"lights": 13}, "lights.count: expected another number, got 13"),
    ({"share": float("nan"), "warp_levels": 1}, "lights.warp.share: expected a number, 0 to 1, got nan"),
    ({"pattern": "random"}, "lights.pattern: expected 'grid' or 'halton', got 'random'"),
    ({"bias": 1.0}, "shadow.bias: expected none or a number, 0 to 0.25, got 1.0"),
    ({"blur": 1}, "blur: expected true or false, got 1"),
    ({"as_published": {"tan", "x"}}, "as_published: expected names out of"),
])
def test_what_is_wrong_is_said_by_its_whole_key(values, message):
    with pytest.raises(InputError) as error:
        of(MethodSettings, **values)
    assert message in str(error.value)


def test_all_errors_come_at_once():
    with pytest.raises(InputError) as error:
        of(MethodSettings, lights=0, blur=3, nothing=1, terms=99)
    for part in ("lights.count", "blur", "nothing", "shadow.terms"):
        assert part in str(error.value)
        assert part in error.value.key


def test_classes_check_themselves():
    with pytest.raises(InputError, match="count: expected a whole number"):
        LightSettings(count=0)
    with pytest.raises(InputError, match="shadow: expected none or csm"):
        MethodSettings(shadow=Warp())


def test_flat_values_make_the_same_settings():
    settings = of(MethodSettings, lights=5, shadow="pcf", texels=3, warp_levels=2, as_published={"tan"})
    assert of(MethodSettings, **flat(settings)) == settings
    assert changed(settings) == {"lights.count": 5, "lights.warp": "warp", "lights.warp.levels": 2,
                                 "lights.warp.share": 0.0, "shadow": "pcf", "shadow.texels": 3,
                                 "as_published": frozenset({"tan"})}


def test_values_change_from_any_start():
    start = of(MethodSettings, shadow="pcf", texels=3)
    assert replaced(start, {"blur": False}) == of(MethodSettings, shadow="pcf", texels=3, blur=False)
    assert replaced(start, {"shadow": "pcf"}) == start


@pytest.mark.parametrize(("pairs", "values"), [
    (["lights=5", "shadow.terms=8"], {"lights": 5, "terms": 8}),
    (["shadow=none"], {"shadow": None}),
    (["shadow=pcf", "texels=9"], {"shadow": Pcf(9)}),
    (["blur=false"], {"blur": False}),
    (["bias=none"], {}),
    (["as_published=tan,no_pi"], {"as_published": {"tan", "no_pi"}}),
    (["warp.share=0.5"], {"warp_share": 0.5}),
])
def test_text_means_the_same(pairs, values):
    assert from_text(MethodSettings(), pairs) == of(MethodSettings, **values)


@pytest.mark.parametrize(("pairs", "message"), [
    (["lights"], "'lights' is not key=value"),
    (["lights=many"], "lights.count: input should be a valid integer"),
    (["lights=0", "blur=maybe"], "blur: input should be a valid boolean"),
    (["termz=3"], "did you mean"),
])
def test_text_that_is_wrong_is_named(pairs, message):
    with pytest.raises(InputError) as error:
        from_text(MethodSettings(), pairs)
    assert message in str(error.value)


def test_printed_forms_go_to_the_parts_that_have_them():
    settings = of(MethodSettings, as_published={"tan", "alpha"})
    assert settings.as_published == {"tan"}
    assert settings.shadow.as_published == {"alpha"}
    assert replaced(settings, {"as_published": "no_pi"}).shadow.as_published == frozenset()
    assert from_text(MethodSettings(), ["as_published=tan,alpha"]) == settings
    with pytest.raises(InputError, match=r"names out of \['alpha', 'no_pi', 'tan'\], got \['x'\]"):
        of(MethodSettings, as_published={"x"})
    with pytest.raises(InputError, match=r"shadow\.as_published: not a setting of shadow=pcf"):
        of(MethodSettings, shadow="pcf", as_published={"alpha"})


def test_leaves_cover_every_choice():
    keys = [leaf.key for leaf in leaves(MethodSettings)]
    assert keys == ["lights.count", "lights.pattern", "lights.warp", "lights.warp.levels", "lights.warp.share",
                    "shadow", "shadow.terms", "shadow.as_published", "shadow.bias", "shadow.texels", "blur",
                    "as_published"]


def test_the_schema_describes_every_key():
    made = schema(MethodSettings)["properties"]
    assert made["lights.count"] == {"description": "pixel lights", "type": "integer", "minimum": 1,
                                    "maximum": 1 << 24}
    assert made["shadow"]["enum"] == ["csm", "pcf", "back_projection", None]
    assert made["shadow.bias"]["type"] == ["number", "null"]
