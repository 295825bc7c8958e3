"""Training settings: one YAML file, checked."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from gyronorth.alignment.networks.bundle import MOST_SAMPLES, Latitude, Positive, Strict
from gyronorth.alignment.networks.diffusion import SEEDS, Sampler, Schedule, check_steps
from gyronorth.errors import InputError
from gyronorth.files import read_bounded, write_text

#: Largest file, bytes.
LARGEST = 1 << 20

Layout = Literal["temporal", "flattened", "across_batch"]
Count = Annotated[int, Field(ge=1, le=10_000_000)]
Layers = Annotated[int, Field(ge=1, le=100)]
Width = Annotated[int, Field(ge=1, le=10_000)]
Fraction = Annotated[float, Field(ge=0, lt=1)]


class SyntheticSettings(Strict):
    """The clean data that train the denoiser (IV-A)."""

    headings: Count = 720  # evenly over the circle: steps of 0.5 deg
    latitude_deg: Latitude = 0.0  # the paper's; a site's own latitude is the other choice


class DenoiserSettings(Strict):
    """The noise-predicting network and its training (III-B)."""

    layers: Layers = 5
    hidden: Width = 64  # per direction
    embedding: Annotated[int, Field(ge=2, le=10_000, multiple_of=2)] = 20  # of the step
    loss: Literal["spectral", "mse"] = "spectral"
    tau: Fraction = 0.9  # singular values up to tau S_max are dropped; the paper gives no value
    rate: Positive = 1e-3  # Adam
    batch: Count = 50
    epochs: Count = 300
    patience: Count = 40  # epochs without a better validation loss


class AugmentSettings(Strict):
    """Copies of each training recording at other headings (IV-A)."""

    copies: Count = 100
    span_deg: Annotated[float, Field(ge=0, le=180)] = 20.0  # from -span to +span
    noise: Literal["faithful", "redrawn"] = "faithful"  # the recording's own noise turned along, or drawn again


class HeadingSettings(Strict):
    """The heading network and its training: the enhanced one (III-D) by default."""

    layers: Layers = 2
    hidden: Width = 24  # per direction
    dropout: Fraction = 0.05  # between the layers and before the head
    output: Literal["degrees", "cos_sin"] = "degrees"
    denoised: bool = True  # the input goes through the denoiser first
    rate: Positive = 0.005  # Adam, eta_max of eq:23
    rate_end: Positive | None = 0.0005  # eta_min, reached at the last epoch; None: no decay
    batch: Count = 32
    epochs: Count = 150
    patience: Count = 40
    augment: AugmentSettings = AugmentSettings()


class Settings(Strict):
    """Everything that decides a training run, with its data."""

    seed: Annotated[int, Field(ge=0, lt=SEEDS)] = 0
    threads: Width = 1
    layout: Layout = "flattened"
    rate_hz: Positive = 3.0
    samples: Annotated[int, Field(ge=2, le=MOST_SAMPLES)] = 300  # 100 s
    normalisation: Literal["sample", "sequence", "channel", "dataset", "none"] = "sequence"
    schedule: Schedule = Schedule()
    sampler: Sampler = Sampler()
    synthetic: SyntheticSettings = SyntheticSettings()
    denoiser: DenoiserSettings = DenoiserSettings()
    heading: HeadingSettings = HeadingSettings()

    @model_validator(mode="after")
    def _check(self) -> Settings:
        check_steps(self.sampler, self.schedule)
        return self


def paper(**changes: object) -> Settings:
    """The paper's system: denoiser and enhanced heading network."""
    return Settings(**changes)  # type: ignore[arg-type]


def baseline(**changes: object) -> Settings:
    """The earlier baseline (arXiv 2312.12121; II-B): no denoiser, dropout or decay; batch 100.

    Learning rate and epochs are those of its public notebook.
    """
    heading = HeadingSettings(
        dropout=0.0, denoised=False, rate=0.0015, rate_end=None, batch=100, epochs=500, patience=100
    )
    return Settings(heading=heading, **changes)  # type: ignore[arg-type]


def own_network(**changes: object) -> Settings:
    """What is left when nothing is kept that does not help: (cos, sin) output, noise redrawn, no denoiser."""
    heading = HeadingSettings(output="cos_sin", denoised=False, augment=AugmentSettings(noise="redrawn"))
    return Settings(heading=heading, **changes)  # type: ignore[arg-type]


def with_cos_sin(**changes: object) -> Settings:
    """The paper's system with a vector for its output, which has no jump on the circle."""
    return Settings(heading=HeadingSettings(output="cos_sin"), **changes)  # type: ignore[arg-type]


#: Settings that come along, by the name that `train --config` takes.
NAMED = {"paper": paper, "baseline": baseline, "cos_sin": with_cos_sin, "own": own_network}


def settings_of(config: str | Path | None) -> Settings:
    """Settings by name or from a YAML file; the paper's for None. A file goes before a name.

    Raises
    ------
    InputError
        If it is neither, or the file is not in order.
    """
    if config is None:
        return paper()
    if str(config) in NAMED and not Path(config).exists():
        return NAMED[str(config)]()
    if not Path(config).is_file():
        raise InputError(
            f"{config} is neither a file nor settings that come along. Give a YAML file, or one of {', '.join(NAMED)}."
        )
    return read_settings(config)


def read_settings(path: str | Path) -> Settings:
    """Settings from a YAML file; what it does not name keeps the paper's value.

    Raises
    ------
    InputError
        If the file is not YAML, or a key or value is not known.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """1e-3 is a number, as in YAML 1.2; and no alias, of which a few lines make a document without end."""

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise yaml.YAMLError("an alias stands in it; write the value itself")
            return super().compose_node(parent, index)

    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
    )
    try:
        content = yaml.load(read_bounded(Path(path), LARGEST).decode("utf-8"), Loader)
        # By way of JSON, where `true` and "3" are no numbers, and a list of plain values is all that a list can be.
        document = json.dumps({} if content is None else content)
    except (yaml.YAMLError, TypeError, ValueError, RecursionError) as error:  # no UTF-8, a date, a circle
        raise InputError(f"{path} is not a YAML file: {' '.join(str(error).split())}.") from None
    try:
        return Settings.model_validate_json(document, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise InputError(f"{path}: {where}: {first['msg']}, got {str(first['input'])[:60]!r}.") from None


def write_settings(settings: Settings, path: str | Path) -> None:
    """Write settings as YAML, every key named.

    Raises
    ------
    InputError
        If the file cannot be written; what stood there is whole then.
    """
    import yaml

    write_text(path, yaml.safe_dump(settings.model_dump(mode="json"), sort_keys=False))
