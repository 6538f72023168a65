"""CAMPAIGN.toml: what varies over a base technique, and how the cases are drawn."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from eddyscan.core.technique import Section, Technique


class Range(Section):
    """Evenly spread between two limits (`log = true`: evenly in the logarithm)."""

    uniform: tuple[float, float]
    log: bool = False
    steps: int = Field(5, ge=2, le=10_000, description="grid points of a factorial design")

    @model_validator(mode="after")
    def _not_empty(self) -> Range:
        low, high = self.uniform
        if not low < high:
            raise ValueError(f"the range {low} .. {high} is empty; the first limit must be below the second")
        if self.log and low <= 0:
            raise ValueError(f"a logarithmic range needs limits above 0, the first is {low}")
        return self


class Normal(Section):
    """Normally distributed: mean and standard deviation."""

    normal: tuple[float, float]
    steps: int = Field(5, ge=2, le=10_000, description="quantiles of a factorial design")

    @model_validator(mode="after")
    def _positive(self) -> Normal:
        if self.normal[1] <= 0:
            raise ValueError(f"the standard deviation {self.normal[1]} must be above 0")
        return self


class Choice(Section):
    """One of a list."""

    list: Annotated[tuple[float | str, ...], Field(min_length=1)]


class Ratio(Section):
    """A fixed multiple of another parameter, for example depth = 0.33 x length."""

    of: str
    times: float = Field(gt=0)


Variation = Range | Normal | Choice | Ratio | float | str


class CampaignHead(Section):
    """What kind of campaign this is."""

    name: str = "campaign"
    depth: Literal["signal", "full"] = "signal"
    design: Literal["factorial", "random", "latin-hypercube"] = "latin-hypercube"
    cases: int = Field(200, ge=1, le=10_000_000, description="number of cases; a factorial design counts its own")
    seed: int = Field(1, ge=0)


class Campaign(Section):
    """The whole of CAMPAIGN.toml."""

    campaign: CampaignHead = CampaignHead()
    vary: dict[str, Variation] = Field(default_factory=dict)
    technique: Technique = Technique()
