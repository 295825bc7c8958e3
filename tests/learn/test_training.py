"""Training: settings, early stopping, checkpoints and what a kill does to them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")
pytest.importorskip("tensorboard", reason="tensorboard comes with the extra train")

from gyronorth.angles import angle_error, cyclic_rmse  # noqa: E402
from gyronorth.errors import InputError  # noqa: E402
from gyronorth.learn.data import HeadingSet, TrainingData, synthetic_set  # noqa: E402
from gyronorth.learn.recurrent import initialised  # noqa: E402
from gyronorth.learn.regressor import HeadingNetwork, crmse_deg  # noqa: E402
from gyronorth.learn.run import run_training  # noqa: E402
from gyronorth.learn.settings import Settings, baseline, paper, read_settings, write_settings  # noqa: E402
from gyronorth.learn.stages import Run, train_denoiser, train_heading  # noqa: E402
from gyronorth.learn.training import Task, decay, fit  # noqa: E402

TINY = Settings.model_validate(
    {
        "samples": 12,
        "synthetic": {"headings": 40},
        "sampler": {"t_back": 997},
        "denoiser": {"layers": 2, "hidden": 6, "epochs": 6, "batch": 10},
        "heading": {"hidden": 5, "epochs": 6, "augment": {"copies": 7}},
    }
)


def changed(settings, **parts):
    tree = settings.model_dump()
    for name, part in parts.items():
        tree[name] = {**tree[name], **part} if isinstance(part, dict) else part
    return Settings.model_validate(tree)


def recordings(n=9, samples=12, seed=0):
    clean = synthetic_set(headings=n, latitude=radians(32), samples=samples)
    noise = 1e-5 * np.random.default_rng(seed).standard_normal(clean.gyro_l.shape)
    return HeadingSet(clean.gyro_l + noise, clean.heading, clean.recording)


def data():
    every = recordings()
    return TrainingData(
        every.rows(np.arange(6)), every.rows(np.arange(6, 9)), source="simulated", latitude=radians(32), sensor="sdc500"
    )


def weights(trained):
    return torch.cat([value.flatten() for value in trained.network.state_dict().values()])


def test_settings_survive_yaml(tmp_path):
    for settings in (paper(), baseline(layout="temporal"), TINY):
        write_settings(settings, tmp_path / "s.yaml")
        assert read_settings(tmp_path / "s.yaml") == settings


def test_the_defaults_are_the_papers():
    s = paper()
    assert (s.schedule.steps, s.schedule.beta_min, s.schedule.beta_max, s.sampler.t_back) == (1000, 1e-4, 5e-4, 950)
    assert (s.denoiser.layers, s.denoiser.hidden, s.denoiser.embedding, s.denoiser.rate, s.denoiser.batch) == (
        5,
        64,
        20,
        1e-3,
        50,
    )
    h = s.heading
    assert (h.layers, h.hidden, h.dropout, h.rate, h.rate_end, h.batch, h.augment.copies) == (
        2,
        24,
        0.05,
        0.005,
        0.0005,
        32,
        100,
    )
    assert (s.normalisation, s.samples, s.rate_hz) == ("sequence", 300, 3.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("denoiser: {width: 3}", "denoiser.width"),
        ("layout: sideways", "layout"),
        ("heading: {dropout: 1.5}", "heading.dropout"),
        ("sampler: {t_back: 1000}", "t_back is 1000"),
        ("schedule: {beta_min: 2}", "0 < min <= max < 1"),
        ("- 1", "the file"),
        ("a: [", "not a YAML file"),
        ("samples: true", "samples: Input should be a valid integer"),
        ("rate_hz: '3'", "rate_hz: Input should be a valid number"),
        ("seed: -1", "seed: Input should be greater"),
        ("a: &a [1, 1]\nsamples: [*a, *a]", "an alias stands in it"),
    ],
)
def test_bad_settings_are_refused_by_name(tmp_path, text, message):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_settings(path)


def test_numbers_of_a_settings_file_are_numbers_of_yaml_1_2(tmp_path):
    path = tmp_path / "settings.yaml"
    path.write_text("denoiser: {rate: 1e-3}\nheading: {rate_end: -5E-4}")
    with pytest.raises(InputError, match=r"heading.rate_end.*got '-0.0005'"):
        read_settings(path)
    path.write_text("denoiser: {rate: 1e-3}")
    assert read_settings(path) == paper()


def test_an_empty_settings_file_is_the_paper(tmp_path):
    (tmp_path / "s.yaml").write_text("")
    assert read_settings(tmp_path / "s.yaml") == paper()


def test_decay_by_hand():
    """eq:23, eq:24: from 0.005 at epoch 0 to 0.0005 at epoch N, by equal factors."""
    rate = decay(0.005, 0.0005, 10)
    assert rate(0) == 0.005
    assert rate(5) == pytest.approx(0.005 / 10**0.5)
    assert rate(10) == pytest.approx(0.0005)
    assert decay(0.005, None, 10)(7) == 0.005


def curve(values, patience=2):
    """A training whose validation loss follows `values`; its only weight counts the epochs."""
    network = torch.nn.Linear(1, 1)
    torch.nn.init.zeros_(network.weight)
    seen = iter(values)

    def loss(index, generator):
        with torch.no_grad():
            network.weight += 1
        return (0 * network.bias).sum()

    task = Task("curve", network, 1, 1, len(values), patience, lambda epoch: 0.1, loss, lambda: next(seen))
    return fit(task, generator=torch.Generator()), network.weight.item()


@pytest.mark.slow
def test_early_stopping_goes_back_to_the_best_epoch():
    progress, epoch = curve([5.0, 3.0, 4.0, 3.0, 1.0, 1.0])
    assert (progress.epoch, progress.best_epoch, progress.best, epoch) == (4, 2, 3.0, 2.0)


def test_divergence_ends_the_training():
    progress, epoch = curve([5.0, 3.0, float("nan"), 1.0])
    assert (progress.epoch, progress.best_epoch, epoch) == (3, 2, 2.0)


def test_a_training_that_never_improves_keeps_its_first_weights():
    progress, epoch = curve([float("nan"), 1.0])
    assert (progress.best_epoch, epoch) == (0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["flattened", "temporal", "across_batch"])
def test_same_seed_same_weights_and_no_global_state(layout):
    settings, before = changed(TINY, layout=layout), torch.get_rng_state()
    first, again = train_denoiser(settings), train_denoiser(settings)
    assert torch.equal(weights(first), weights(again))
    assert not torch.equal(weights(first), weights(train_denoiser(changed(settings, seed=1))))
    heads = [train_heading(settings, data(), first) for _ in range(2)]
    assert torch.equal(weights(heads[0]), weights(heads[1]))
    assert torch.equal(torch.get_rng_state(), before)
    assert heads[0].headings(data().validation.gyro_l).shape == (3,)


@pytest.mark.parametrize("layout", ["flattened", "temporal"])
def test_weights_end_where_a_plain_optimiser_takes_them_bit_by_bit(layout):
    """The gates of a single step are held together during a training; here every parameter is its own.

    Of the same length but for whole vectors of the processor, at whose ends the fused optimiser rounds otherwise.
    """

    def network():
        return initialised(lambda: HeadingNetwork(layout=layout, samples=12, hidden=8, dropout=0.1), seeded())

    def seeded():
        return torch.Generator().manual_seed(3)

    def loss(index, generator):
        return crmse_deg(held(x[index], generator), y[index])

    x, y, held, plain = torch.randn((20, 12, 3), generator=seeded()), torch.arange(20.0), network(), network()
    progress = fit(
        Task("plain", held, 20, 8, 4, 4, decay(0.01, 0.001, 4), loss, lambda: 0.0, last=True), generator=seeded()
    )
    optimiser, generator = torch.optim.Adam(plain.parameters(), fused=True), seeded()
    for epoch in range(4):
        optimiser.param_groups[0]["lr"] = decay(0.01, 0.001, 4)(epoch)
        for index in torch.randperm(20, generator=generator).split(8):
            optimiser.zero_grad()
            crmse_deg(plain(x[index], generator), y[index]).backward()
            optimiser.step()
    assert progress.epoch == 4
    first = network().state_dict()
    for name, value in plain.state_dict().items():
        assert torch.equal(held.state_dict()[name], value), name
        assert layout == "flattened" or not torch.equal(first[name], value), name
    assert not any(getattr(layer, "held", None) for layer in held.modules())


def test_a_test_part_is_recorded_and_decides_nothing():
    settings = changed(TINY, heading={"denoised": False})
    plain = train_heading(settings, data(), None)
    watched = train_heading(settings, replace(data(), test=recordings(3, seed=4)), None)
    assert torch.equal(weights(plain), weights(watched))
    assert [set(entry) - {"loss", "validation", "rate"} for entry in watched.progress.history] == [{"test"}] * 6
    error = angle_error(watched.headings(recordings(3, seed=4).gyro_l), recordings(3, seed=4).heading)
    best = watched.progress.history[watched.progress.best_epoch - 1]
    assert np.degrees(cyclic_rmse(error)) == pytest.approx(best["test"], rel=1e-4)


@pytest.mark.parametrize("normalisation", ["sample", "sequence", "channel", "dataset", "none"])
def test_every_normalisation_trains(normalisation):
    trained = train_denoiser(changed(TINY, normalisation=normalisation, denoiser={"epochs": 1}))
    gyro = data().train.gyro_l
    assert trained.clean(gyro).shape == gyro.shape
    assert np.isfinite(trained.clean(gyro)).all()


def test_mean_square_loss_trains_differently():
    assert not torch.equal(
        weights(train_denoiser(TINY)), weights(train_denoiser(changed(TINY, denoiser={"loss": "mse"})))
    )


def lines(folder, name):
    return [json.loads(line) for line in (folder / f"{name}.jsonl").read_text().splitlines()]


@pytest.mark.slow
def test_a_whole_training_writes_its_logs(tmp_path, capsys):
    bundle = run_training(TINY, "all", data(), tmp_path / "b", progress=True)
    assert bundle.method == "paper"
    assert (tmp_path / "b" / "heading.onnx").is_file()
    folder = tmp_path / "b.training"
    for name in ("denoiser", "heading"):
        entries = lines(folder, name)
        assert [entry["epoch"] for entry in entries] == [1, 2, 3, 4, 5, 6]
        assert set(entries[0]) == {"epoch", "loss", "validation", "rate", "seconds"}
        assert list((folder / "tensorboard" / name).iterdir())
        assert name in capsys.readouterr().out or name == "heading"
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.slow
def test_stages_one_by_one_end_where_both_together_do(tmp_path):
    both = run_training(TINY, "all", data(), tmp_path / "both")
    alone = run_training(TINY, "denoiser", None, tmp_path / "b")
    assert alone.method == "denoiser"
    after = run_training(TINY, "regressor", data(), tmp_path / "b")
    assert (after.heading, after.denoiser) == (both.heading, both.denoiser)


def test_a_baseline_needs_no_denoiser(tmp_path):
    settings = changed(TINY, heading={"denoised": False})
    bundle = run_training(settings, "regressor", data(), tmp_path / "b")
    assert (bundle.method, bundle.denoiser) == ("baseline", None)


def test_what_cannot_be_trained_is_refused(tmp_path):
    with pytest.raises(InputError, match="give --data FOLDER"):
        run_training(TINY, "all", None, tmp_path / "b")
    with pytest.raises(InputError, match="holds no trained denoiser"):
        run_training(TINY, "regressor", data(), tmp_path / "b")
    with pytest.raises(InputError, match="across_batch cannot be exported"):
        run_training(changed(TINY, layout="across_batch"), "denoiser", None, tmp_path / "b")
    with pytest.raises(InputError, match="2 recordings; at least 3"):
        run_training(changed(TINY, synthetic={"headings": 2}), "denoiser", None, tmp_path / "b")
    assert list(tmp_path.iterdir()) == []  # nothing is begun
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    for name, message in (("full", "not empty and not a bundle"), ("full/mine.txt", "is a file; give a new folder")):
        with pytest.raises(InputError, match=message):
            run_training(TINY, "denoiser", None, tmp_path / name)
    assert [path.name for path in tmp_path.rglob("*")] == ["full", "mine.txt"]
    run_training(TINY, "denoiser", None, tmp_path / "b")
    with pytest.raises(InputError, match="--resume"):
        run_training(TINY, "denoiser", None, tmp_path / "b")
    with pytest.raises(InputError, match="differs from the settings"):
        run_training(changed(TINY, seed=5), "denoiser", None, tmp_path / "b", resume=True)


def test_a_checkpoint_of_other_data_is_refused(tmp_path):
    train_heading(changed(TINY, heading={"denoised": False}), data(), None, run=Run(tmp_path))
    other = replace(data(), train=recordings(6, seed=1))
    with pytest.raises(InputError, match="other settings, data"):
        train_heading(changed(TINY, heading={"denoised": False}), other, None, run=Run(tmp_path))


class Killed(BaseException):
    """Stands for a kill inside this process."""


@pytest.mark.slow
@pytest.mark.parametrize("moment", [7, *(pytest.param(moment, marks=pytest.mark.long) for moment in (1, 4, 10))])
def test_resuming_after_a_kill_while_a_checkpoint_is_written(tmp_path, monkeypatch, moment):
    """The rename of the n-th file written, checkpoint or log, never happens."""
    reference = run_training(TINY, "all", data(), tmp_path / "reference")
    rename, count = os.replace, 0

    def killed(source, target):
        nonlocal count
        count += 1
        if count == moment:
            raise Killed
        rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", killed)
        with pytest.raises(Killed):
            run_training(TINY, "all", data(), tmp_path / "b")
    assert run_training(TINY, "all", data(), tmp_path / "b", resume=True) == reference
    assert [entry["epoch"] for entry in lines(tmp_path / "b.training", "heading")] == [1, 2, 3, 4, 5, 6]


@pytest.mark.long  # a kill while a file is written: above
def test_killing_at_20_random_moments_loses_at_most_the_running_epoch(tmp_path):
    """SIGKILL to the process; an epoch that the log shows is saved, and the bundle in the end is the same."""
    settings = changed(
        TINY,
        denoiser={"epochs": 80, "patience": 80, "hidden": 16},
        heading={"epochs": 80, "patience": 80, "hidden": 16},
    )
    reference = run_training(settings, "all", data(), tmp_path / "reference")
    write_settings(settings, tmp_path / "settings.yaml")
    parts = {"t": data().train, "v": data().validation}
    arrays = {f"{part}_{name}": value for part, one in parts.items() for name, value in vars(one).items()}
    np.savez(tmp_path / "data.npz", **arrays)
    program = Path(__file__).parents[1] / "kill_training.py"
    child = subprocess.run([sys.executable, program, tmp_path], capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    kills = [json.loads(line) for line in child.stdout.splitlines()]
    assert len(kills) == 20
    for kill in kills:
        for in_log, in_checkpoint in zip(kill["logged"], kill["saved"], strict=True):
            assert in_log <= in_checkpoint <= in_log + 1
    assert len({tuple(kill["saved"]) for kill in kills}) >= 10  # they fell at many epochs
    simulated = replace(data(), source="", latitude=None, sensor=None)
    after = run_training(settings, "all", simulated, tmp_path / "b", resume=True)
    assert (after.denoiser, after.heading) == (reference.denoiser, reference.heading)


def test_settings_that_come_along_are_known_by_name(tmp_path, monkeypatch):
    from gyronorth.learn.settings import NAMED, settings_of

    monkeypatch.chdir(tmp_path)
    assert settings_of(None) == settings_of("paper") == paper()
    assert settings_of("baseline") == baseline()
    assert settings_of("cos_sin").heading.output == "cos_sin"
    assert {settings_of(name).heading.denoised for name in NAMED} == {True, False}
    write_settings(TINY, tmp_path / "baseline")  # a file of that name goes before
    assert settings_of("baseline") == TINY
    with pytest.raises(InputError, match="neither a file nor settings that come along"):
        settings_of("basline")


@pytest.mark.slow
def test_a_network_that_has_learned_nothing_is_told(tmp_path):
    from gyronorth.learn.export import untrained

    bundle = run_training(TINY, "all", data(), tmp_path / "b")
    assert "not trained: it errs by" in untrained(bundle.metrics)
    assert untrained(bundle.metrics) in (tmp_path / "b/README.md").read_text()
    assert untrained({"train_network_crmse_deg": 9.0, "train_model_based_crmse_deg": 4.0}) == ""
    assert untrained({"denoiser_epochs": 3.0}) == ""


def test_the_guide_names_every_setting():
    """The last part of a name stands in the table; a group's name before it."""
    table = (Path(__file__).parents[2] / "docs/guide/learning.md").read_text()
    words = set(re.findall(r"`(?:[a-z_]+\.)*([a-z_]+)`", "\n".join(re.findall(r"^\| `.*$", table, re.M))))

    def names(model):
        for name, field in model.model_fields.items():
            if hasattr(field.annotation, "model_fields"):
                yield from names(field.annotation)
            else:
                yield name

    assert set(names(Settings)) - words - {"schedule", "sampler"} == set()
