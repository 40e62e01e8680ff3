"""Autofocus, tracks and moving targets, against the errors and motions that were put in."""

import numpy as np
import pytest

import subaperture as sar

GRID = "x=-45:45:0.25,y=-45:45:0.35,z=0"


def test_phase_error_is_estimated_and_removed():
    clean = sar.simulate("table-4-1")
    pulses, samples = clean.shape
    # A smooth phase error over the aperture, of no constant or linear part: those shift the image only.
    at = np.linspace(-1, 1, pulses)
    error = 10.0 * (at**2 - 1 / 3) + 1.0 * (at**3 - 0.6 * at)
    blurred = sar.phase_history(
        clean.samples() * np.exp(1j * error)[:, None],
        start_hz=clean.start_hz,
        step_hz=clean.step_hz,
        transmitter_m=clean.transmitter_m,
        receiver_m=clean.receiver_m,
        reference_path_m=clean.reference_path_m,
        sign=-1,
        time_s=clean.time_s,
    )
    found = sar.autofocus(blurred, GRID)
    assert found.kept and found.report["outcome"] == "sharper", found.report
    residual = np.unwrap(found.phase_rad - error)
    residual -= np.polyval(np.polyfit(at, residual, 1), at)
    # The cubic is 0.15 rad rms.
    assert np.sqrt(np.mean(residual**2)) < 0.1
    sharp = sar.focus(found.corrected(), GRID)
    assert sharp.statistics()["entropy"] < sar.focus(blurred, GRID).statistics()["entropy"]


def test_track_is_estimated_from_echoes():
    channels = sar.simulate_channels("walk")
    track = sar.track(channels)
    # The scenario: 1 m/s along x, and 6 cm of sway at 0.4 Hz along y. The estimate is free in place and heading.
    time = track.time_s
    true = np.column_stack([-2 + time, 0.06 * np.sin(2 * np.pi * 0.4 * time)])
    centred = [path - path.mean(axis=0) for path in (track.position_m[:, :2], true)]
    u, _, v = np.linalg.svd(centred[0].T @ centred[1])
    error = centred[0] @ (u @ v) - centred[1]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.02
    assert len(track.pulse) == len(time) == len(track.deviation_m) and len(track.targets_m) >= 3
    # On the estimated track the points of the scenario are sharp.
    grid = "x=-6:6:0.05,y=4:12:0.05,z=0"
    recorded, estimated = [sar.focus(each.coherent_sum(), grid, beam="none") for each in (channels, track.applied(channels))]
    assert estimated.statistics()["peak_level_db"] > -1.0 > recorded.statistics()["peak_level_db"] + 1.0
    with pytest.raises(sar.UnsuitedError):
        sar.track(sar.simulate_channels("table-4-1"))


def test_moving_targets_have_their_velocities():
    found = sar.gmti(sar.simulate_channels("gmti"))
    velocities = sorted(target["radial_velocity_m_s"] for target in found.targets)
    # Velocities of the scenario towards the radar, 5 km away and 3 km high on -y, as `gmti.toml` states them.
    assert len(found) == 3
    assert velocities[0] < 0 < velocities[1] < velocities[2]
    with pytest.raises(sar.UnsuitedError, match="two channels"):
        sar.gmti(sar.simulate_channels("table-4-1"))
    with pytest.raises(sar.ArgumentError, match="false_alarms"):
        sar.gmti(sar.simulate_channels("gmti"), false_alarms=2)


def test_scene_has_the_truth_of_a_scenario():
    scene = sar.scene("gmti")
    recording = sar.simulate_channels("gmti")[0]
    time = recording.time_s
    # As `gmti.toml` states them: positions at the middle of the collection, velocities, cross sections.
    velocities = np.array([[0, 1.0, 0], [0, -1.5, 0], [1.0, -0.5, 0]])
    starts = np.array([[0, 0, 0], [-25, -40, 0], [20, 30, 0]])
    middle = 0.5 * (time[0] + time[-1])
    expected = starts[:, None] + velocities[:, None] * (time - middle)[:, None]
    # The middle of the collection may be half a pulse later: 0.5 ms at 1.5 m/s.
    assert np.abs(scene.mover_m(time) - expected).max() < 1e-3
    # Positions of metres, rounded to 2^-47 m, over 1 ms.
    assert np.allclose(scene.mover_velocity_m_s(time), velocities[:, None], atol=1e-9)
    assert np.allclose(np.abs(scene.mover_amplitude) ** 2, [5, 10, 5])
    assert scene.point_m.shape == (len(scene.point_amplitude), 3)
    with pytest.raises(sar.ArgumentError, match="finite"):
        scene.mover_m([np.nan])
    assert sar.scene("table-2-1").mover_m(time).shape == (0, len(time), 3)


def test_echoes_are_those_of_the_scene():
    recording = sar.simulate("table-4-1")
    scene = sar.scene("table-4-1")
    f = recording.start_hz[:, None] + recording.step_hz[:, None] * np.arange(recording.shape[1])
    for pulse in (0, 500, 1039):
        path = np.linalg.norm(recording.transmitter_m[pulse] - scene.point_m, axis=1)
        path += np.linalg.norm(recording.receiver_m[pulse] - scene.point_m, axis=1)
        path -= recording.reference_path_m[pulse]
        phase = -2 * np.pi / 299792458.0 * path[:, None] * f[pulse]
        echo = np.sum(scene.point_amplitude[:, None] * np.exp(1j * phase), axis=0)
        # Samples are complex64: 41 units rounded to 2^-24 of their sum.
        assert np.abs(recording.samples(pulse, pulse + 1)[0] - echo).max() < 41 * 2**-23


def test_channels_are_a_sequence():
    channels = sar.simulate_channels("gmti")
    assert channels.names == ["T1R1", "T1R2", "T1R3"] and len(channels) == 3
    receivers = [channel.receiver_m for channel in channels]
    # Offsets of the receivers along the track, as the scenario states them.
    for receiver, offset in zip(receivers, [0.4, 0.0, -0.6], strict=True):
        assert receiver[0, 0] - receivers[1][0, 0] == pytest.approx(offset, abs=1e-9)
    assert np.array_equal(channels[-1].receiver_m, channels["T1R3"].receiver_m)
    with pytest.raises(IndexError):
        channels[3]
    with pytest.raises(sar.ArgumentError, match="simulate_channels"):
        sar.simulate("gmti")
