"""`EpisodePlan`: what is special about one episode - stressors, a twin, somebody's own planner. JSON in and out."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from pydantic import Field, model_validator

from stylesim.errors import InputError, unknown
from stylesim.scene import Scene
from stylesim.specs import Spec
from stylesim.style import STYLE_CLASSES, DriverStyle

StressorKind = Literal["hard_brake", "cut_in", "jaywalker", "deer", "stalled", "red_runner"]
STRESSOR_KINDS: tuple[StressorKind, ...] = ("hard_brake", "cut_in", "jaywalker", "deer", "stalled", "red_runner")
NOISE_SALT = "null"  # what is added to the purposes of a null twin's streams


class Stressor(Spec):
    """One kind of unusual event, and the share of episodes in which it is tried (at a seeded moment)."""

    kind: StressorKind
    share: float = Field(default=1.0, gt=0.0, le=1.0)


class Twin(Spec):
    """The one driver of a counterfactual episode that differs from the episode it is the twin of.

    From the frame after `at_s` on (seconds of the log; None: from its insertion on) `driver` has the style `style`.
    With `new_noise` its random streams (pedal, wander, answers to yellow lights) go on from another seed there.
    """

    name: str = Field(pattern=r"^[a-z_]{1,16}$")  # of the variant; the scene's id ends in it
    driver: str
    style: DriverStyle
    from_style: str  # the class that it has in the episode
    at_s: float | None = Field(default=None, ge=0.0)
    new_noise: bool = False


class TwinRequest(Spec):
    """Twins that are wanted of every episode: the driver is drawn, then `style` (drawn too if it is "").

    With `null` there is a second twin beside it: the same driver keeps its style and gets other noise.
    """

    at_s: float | None = Field(default=None, ge=0.0)  # None: from the driver's insertion on
    style: str = ""
    null: bool = True

    @model_validator(mode="after")
    def _known(self) -> TwinRequest:
        if self.style and self.style not in STYLE_CLASSES:
            raise unknown("style", self.style, STYLE_CLASSES, where="twins")
        return self


class EpisodePlan(Spec):
    """Everything that distinguishes an episode from the plain one of the same scenario, population and seed."""

    stressors: tuple[Stressor, ...] = ()
    twin: Twin | None = None
    ego: str = ""  # entry point (package.module:name) of a planner that drives one vehicle; "" for none

    @model_validator(mode="after")
    def _once(self) -> EpisodePlan:
        kinds = [stressor.kind for stressor in self.stressors]
        for kind in kinds:
            if kinds.count(kind) > 1:
                raise InputError(f"stressor {kind!r} is given {kinds.count(kind)} times; give it once")
        return self

    def applied_to(self, scene: Scene) -> Scene:
        """The scene under the id that this plan gives it, paired with the episode that it is the twin of.

        A twin belongs to the unit of that episode: they share a history, so no split may part them.
        """
        if self.twin is None:
            return scene
        twin = self.twin
        about = {
            "variant": twin.name,
            "driver": twin.driver,
            "from_style": twin.from_style,
            "to_style": twin.style.name,
            "at_s": twin.at_s,
            "new_noise": twin.new_noise,
        }
        return replace(
            scene,
            scene_id=f"{scene.scene_id}-{twin.name}",
            twin_of=scene.scene_id,
            metadata={**scene.metadata, "twin": about},
        )


PLAIN = EpisodePlan()


def salted(purpose: str, *, new_noise: bool) -> str:
    """The purpose of a driver's random stream, or that of its null twin's."""
    return f"{purpose} {NOISE_SALT}" if new_noise else purpose


def stressors_of(text: str, *, where: str = "--stressor") -> tuple[Stressor, ...]:
    """`deer,jaywalker:0.5` as stressors.

    InputError for an unknown kind, naming the nearest, and for a share outside (0, 1].
    """
    found = []
    for item in text.split(","):
        kind, colon, value = item.strip().partition(":")
        if kind not in STRESSOR_KINDS:
            raise unknown("stressor", kind, STRESSOR_KINDS, where=where)
        try:
            share = float(value) if colon else 1.0
        except ValueError:
            raise InputError(f"{where}: the share of {kind!r} is no number: {value!r}") from None
        if not 0.0 < share <= 1.0:
            raise InputError(f"{where}: the share of {kind!r} must lie in (0, 1], not {value}")
        found.append(Stressor(kind=kind, share=share))
    return tuple(found)
