"""The quick version of benchmarks/device_round_trip.py."""

from benchmarks import device_round_trip


def test_half_a_second_of_round_trips(tmp_path):
    found = device_round_trip.main(tmp_path, seconds=0.5, rate=200.0)
    assert 0 < found["exchanges"] <= 101 and found["missed"] == 0
    assert 0.0 < found["latency_p50_p99_s"][0] <= found["latency_p50_p99_s"][1] < 1.0
    assert 0.0 < found["real_time_factor"] < 1.05
    page = (tmp_path / "device_round_trip.md").read_text()
    assert "round trip, median" in page
    assert (tmp_path / "device_round_trip.png").stat().st_size > 1000
